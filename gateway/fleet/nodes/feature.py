"""Nodes across devices as one part of the gateway: the desks for people."""

from __future__ import annotations

from gateway.fleet.commands import CommandDesk
from gateway.fleet.desk import FleetDesk
from gateway.fleet.node_logs import NodeLogs
from gateway.fleet.node_values import NodeValues
from gateway.fleet.node_verbs import NodeVerbs
from gateway.fleet.nodes import Holder, NodeDesk, nobody
from gateway.fleet.orders import OrderDesk
from gateway.fleet.robots import FindRobot
from gateway.fleet.twin_drift import Drift, Emit
from gateway.fleet.twin_feature import Twins
from metaros.clock import Clock

__all__ = ["Nodes"]


class Nodes:
    """`desk` looks and changes rows of twins, `verbs` starts and stops, `logs` reads, `values` sets parameters."""

    def __init__(
        self,
        twins: Twins,
        find: FindRobot,
        commands: CommandDesk,
        fleet: FleetDesk,
        orders: OrderDesk,
        *,
        clock: Clock,
        holder_of: Holder = nobody,
        emit: Emit | None = None,
    ) -> None:
        """`holder_of`: the robot that has the lease of a robot's migratable node; `emit` is told of drift."""
        self.desk = NodeDesk(twins, find, holder_of=holder_of)
        self.verbs = NodeVerbs(self.desk, twins, commands, orders, clock=clock)
        self.logs = NodeLogs(self.desk, find, commands, clock=clock)
        self.values = NodeValues(self.desk, twins, fleet, orders)
        if emit is not None:
            twins.book.watch(Drift(twins.book, emit, holder_of=holder_of).on_report)
