"""Watches the graph, and tells the gateway what changed in this robot's part of it, at most twice a second."""

from __future__ import annotations

import asyncio

from edge_agent.ros.report import GraphTeller
from edge_agent.ros.survey import Survey, survey
from edge_agent.ros.types import TypeLearner
from edge_agent.scope import Scope
from edge_agent.uplink.desk import Tell
from metaros._proto import link_pb2
from metaros.limits import LIMITS, Limits
from metaros.node import Node
from metaros.wire import EndpointInfo

__all__ = ["GraphWatch"]


class GraphWatch:
    """`link` gives it somebody to tell; `run` does it. All on the event loop; the survey is made in a thread."""

    def __init__(self, node: Node, scope: Scope, *, limits: Limits = LIMITS) -> None:
        self._node = node
        self._scope = scope
        self._limits = limits
        self._loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()
        self._linked = asyncio.Event()
        self._tell: Tell | None = None
        self._book = GraphTeller(limits=limits)
        self._types = TypeLearner(node, self._changed.set, limits=limits)
        self._unwatch = node.graph.on_change(self._on_change)

    def link(self, tell: Tell | None) -> None:
        """Another link, or none."""
        self._tell = tell
        self._book.begin()
        if tell is None:
            self._linked.clear()
        else:
            self._linked.set()
            self._changed.set()

    async def run(self) -> None:
        """Until cancelled."""
        try:
            while True:
                await self._linked.wait()
                await self._changed.wait()
                self._changed.clear()
                to = self._tell
                seen = await asyncio.to_thread(self._survey)
                if to is not None and to is self._tell:  # else another link has begun: it is told from the start
                    self._types.look(seen.ends.values())
                    for report in self._book.tell(seen, self._types.texts):
                        to(link_pb2.AgentFrame(graph=report))
                else:
                    self._changed.set()
                await asyncio.sleep(self._limits.graph_report_s)
        finally:
            self._unwatch()
            await self._types.close()

    def _survey(self) -> Survey:
        graph, own = self._node.graph, (self._node.context.zid, self._node.full_name)
        return survey(graph.nodes(), graph.endpoints(), self._scope, own=own, shows=self._shows)

    @staticmethod
    def _shows(info: EndpointInfo) -> bool:
        """Of the agent's own node: what it publishes for people. Not that it listens, or calls."""
        return info.kind == "MP"

    def _on_change(self) -> None:
        """On the graph's thread."""
        try:
            self._loop.call_soon_threadsafe(self._changed.set)
        except RuntimeError:  # the loop is closed: the program ends
            return
