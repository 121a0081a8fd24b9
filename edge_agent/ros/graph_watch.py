"""Watches the ROS graph, and reports changes in this robot's part to the gateway, at most twice a second."""

from __future__ import annotations

import asyncio

from edge_agent.forwarding.scope import Scope
from edge_agent.link.handler import SendFrame
from edge_agent.ros.graph_report import GraphReporter
from edge_agent.ros.graph_snapshot import GraphSnapshot, take_snapshot
from edge_agent.ros.types import GraphTypeDiscovery
from metaros._proto import link_pb2
from metaros.limits import LIMITS, Limits
from metaros.node import Node
from metaros.wire import EndpointInfo

__all__ = ["GraphWatch"]


class GraphWatch:
    """`link` sets where reports go; `run` sends them. All on the event loop; snapshots are taken in a thread."""

    def __init__(self, node: Node, scope: Scope, *, limits: Limits = LIMITS) -> None:
        self._node = node
        self._scope = scope
        self._limits = limits
        self._loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()
        self._linked = asyncio.Event()
        self._send_frame: SendFrame | None = None
        self._reporter = GraphReporter(limits=limits)
        self._types = GraphTypeDiscovery(node, self._changed.set, limits=limits)
        self._unwatch = node.graph.on_change(self._on_change)

    def link(self, send: SendFrame | None) -> None:
        """Another link, or none."""
        self._send_frame = send
        self._reporter.begin()
        if send is None:
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
                to = self._send_frame
                seen = await asyncio.to_thread(self._take_snapshot)
                if (
                    to is not None and to is self._send_frame
                ):  # else another link has begun: it gets everything from the start
                    self._types.look(seen.endpoints.values())
                    for report in self._reporter.changes(seen, self._types.texts):
                        to(link_pb2.AgentFrame(graph=report))
                else:
                    self._changed.set()
                await asyncio.sleep(self._limits.graph_report_s)
        finally:
            self._unwatch()
            await self._types.close()

    def _take_snapshot(self) -> GraphSnapshot:
        graph, own = self._node.graph, (self._node.context.zid, self._node.full_name)
        return take_snapshot(graph.nodes(), graph.endpoints(), self._scope, own=own, shows=self._shows)

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
