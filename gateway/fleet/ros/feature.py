"""Robots' ROS graphs as one feature of the gateway: their contents, goals for actions, and what clients offer."""

from __future__ import annotations

import asyncio
from typing import Final

from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.manager import FleetManager
from gateway.fleet.robots import FindRobot, SendFrame
from gateway.fleet.ros.goals import GoalManager
from gateway.fleet.ros.graph_registry import GraphRegistry
from gateway.fleet.ros.offers import OfferManager
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["RosFeature"]

TICK_S: Final = 1.0


class RosFeature:
    """`graphs`, `goals` and `offers` for clients; all methods on the event loop."""

    def __init__(
        self,
        find: FindRobot,
        commands: CommandDispatcher,
        fleet: FleetManager,
        send: SendFrame,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self.graphs = GraphRegistry(limits=limits)
        self.goals = GoalManager(find, commands, fleet, self.graphs, clock=clock, limits=limits)
        self.offers = OfferManager(find, send, self.graphs, limits=limits)
        fleet.use_graphs(self.graphs.of)

    def on_frame(self, robot_id: str, frame: link_pb2.AgentFrame) -> None:
        """One of the frames that a session leaves to this part."""
        match frame.WhichOneof("frame"):
            case "graph":
                self.graphs.on_report(robot_id, frame.graph)
            case "goals":
                self.goals.on_events(robot_id, frame.goals)
            case "offer_states":
                self.offers.on_states(robot_id, frame.offer_states)
            case "asked":
                self.offers.on_asked(robot_id, frame.asked)

    def on_online(self, robot_id: str, online: bool) -> None:
        """A robot's link began or ended."""
        self.goals.on_online(robot_id, online=online)
        self.offers.on_online(robot_id, online=online)

    async def run(self) -> None:
        """What happens by time alone, until cancelled."""
        while True:
            await asyncio.sleep(TICK_S)
            self.goals.tick()
