"""Robots' nodes as one feature of the gateway."""

from __future__ import annotations

from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.command_manager import CommandManager
from gateway.fleet.manager import FleetManager
from gateway.fleet.nodes.logs import NodeLogs
from gateway.fleet.nodes.manager import Holder, NodeManager, nobody
from gateway.fleet.nodes.values import NodeValues
from gateway.fleet.nodes.verbs import NodeVerbs
from gateway.fleet.robots import FindRobot
from gateway.fleet.twins.drift import Drift, Emit
from gateway.fleet.twins.feature import Twins
from metaros.clock import Clock

__all__ = ["Nodes"]


class Nodes:
    """`manager` looks and changes rows of twins, `verbs` starts and stops, `logs` reads, `values` sets parameters."""

    def __init__(
        self,
        twins: Twins,
        find: FindRobot,
        commands: CommandDispatcher,
        fleet: FleetManager,
        command_manager: CommandManager,
        *,
        clock: Clock,
        holder_of: Holder = nobody,
        emit: Emit | None = None,
    ) -> None:
        """`holder_of`: the robot that has the lease of a robot's migratable node; `emit` is told of drift."""
        self.manager = NodeManager(twins, find, holder_of=holder_of)
        self.verbs = NodeVerbs(self.manager, twins, commands, command_manager, clock=clock)
        self.logs = NodeLogs(self.manager, find, commands, clock=clock)
        self.values = NodeValues(self.manager, twins, fleet, command_manager)
        if emit is not None:
            twins.cache.watch(Drift(twins.cache, emit, holder_of=holder_of).on_report)
