"""Control handler for the robot's ROS graph: reports it, tracks goals, serves what clients offer."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING

from edge_agent.forwarding.scope import Scope
from edge_agent.link.frames import ControlFrame
from edge_agent.link.handler import SendFrame
from edge_agent.ros.goals import GoalRunner
from edge_agent.ros.graph_watch import GraphWatch
from edge_agent.ros.offers import OfferManager
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits
from metaros.node import Node

if TYPE_CHECKING:
    from edge_agent.commands.dispatcher import Action

__all__ = ["RosManager"]


class RosManager:
    """See ControlHandler. A gateway that does not know these frames is sent none of them."""

    frames = frozenset({"offers", "offer_answer"})

    def __init__(self, node: Node, scope: Scope, clock: Clock, *, limits: Limits = LIMITS) -> None:
        self._graph = GraphWatch(node, scope, limits=limits)
        self._goals = GoalRunner(node, scope, clock, limits=limits)
        self._offers = OfferManager(node, scope, limits=limits)

    @property
    def actions(self) -> Mapping[str, Action]:
        """The commands about goals, by their names in `Command.action`."""
        return self._goals.actions

    def link_up(self, send: SendFrame, welcome: link_pb2.Welcome) -> None:
        """See ControlHandler."""
        self._link(send if welcome.graph else None)

    def link_down(self) -> None:
        """See ControlHandler."""
        self._link(None)

    def take(self, received: ControlFrame) -> None:
        """See ControlHandler."""
        self._offers.take(received.frame)

    async def run(self) -> None:
        """Until cancelled; then nothing is followed or served any more."""
        try:
            async with asyncio.TaskGroup() as group:
                for part in (self._graph, self._goals, self._offers):
                    group.create_task(part.run())
        finally:
            await self._goals.close()

    def _link(self, send: SendFrame | None) -> None:
        for part in (self._graph, self._goals, self._offers):
            part.link(send)
