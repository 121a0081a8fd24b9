"""The node manager's control handler: leases of migratable nodes, and the commands about nodes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

from edge_agent.commands.dispatcher import Action
from edge_agent.link.frames import ControlFrame
from edge_agent.link.handler import SendFrame
from edge_agent.nodes.lease_stamps import LeaseStamps
from edge_agent.nodes.manager import NodeManager
from metaros._proto import link_pb2
from metaros.clock import boot_s
from metaros.errors import MetarosError

__all__ = ["NodeLinkHandler"]

LOG = logging.getLogger("metaros.agent.nodes")


class NodeLinkHandler:
    """Takes NodeLeases frames and answers each; `actions` are for the agent's commands."""

    def __init__(self, manager: NodeManager, *, lease_s: Callable[[], float] = boot_s) -> None:
        self.manager = manager
        self.frames = frozenset({"node_leases"})
        self._lease_s = lease_s
        self._send_frame: SendFrame = _nobody
        self._stamps = LeaseStamps()
        self._newest: tuple[list[link_pb2.NodeLease], float] | None = None
        self._held = False
        self._came = asyncio.Event()

    @property
    def actions(self) -> Mapping[str, Action]:
        """By their names in `Command.action`."""
        return {"node_verb": self._verb, "read_log": self._read_log}

    def link_up(self, send: SendFrame, welcome: link_pb2.Welcome) -> None:
        """The gateway asks; a stamp of another link gives no lease over this one."""
        self._send_frame = send
        self._stamps.forget()

    def link_down(self) -> None:
        """The leases run out by themselves, unless the link is back in time."""
        self._send_frame = _nobody
        self._stamps.forget()

    def take(self, received: ControlFrame) -> None:
        """The leases that are held now, from a stamp that we sent over this link; answered with a new stamp."""
        frame = received.frame.node_leases
        moment = link_pb2.LeasesTaken(boot_ns=self._stamps.issue(round(self._lease_s() * 1e9)))
        self._send_frame(link_pb2.AgentFrame(leases_taken=moment))
        leases = list(frame.leases)
        if self._stamps.knows(frame.since_ns) and (leases or self._held):
            self._held = bool(leases)
            self._newest = (leases, frame.since_ns / 1e9)
            self._came.set()

    async def run(self) -> None:
        """Run the manager, and hand leases to the supervisor, for ever."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.manager.run())
            group.create_task(self._hand_over())

    async def _hand_over(self) -> None:
        while True:
            await self._came.wait()
            self._came.clear()
            if self._newest is None:
                continue
            leases, at_s = self._newest
            try:
                await self.manager.leases(leases, at_s=at_s)
            except MetarosError as error:
                if leases:
                    LOG.warning("leases: %s", error)

    async def _verb(self, command: link_pb2.Command, remaining_s: float) -> bytes:
        what = command.node_verb
        return await self.manager.verb(what.node, what.verb, what.signal, timeout_s=max(remaining_s, 0.1))

    async def _read_log(self, command: link_pb2.Command, remaining_s: float) -> bytes:
        what = command.read_log
        return await self.manager.read_log(
            what.node, cursor=what.cursor, max_bytes=what.max_bytes, query=what.query, backwards=what.backwards
        )


def _nobody(frame: link_pb2.AgentFrame) -> None:
    """There is no link."""
