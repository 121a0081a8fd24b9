"""The nodes' desk on the link: leases of migratable nodes, and the commands about nodes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

from edge_agent.commands import Action
from edge_agent.nodes.desk import NodeDesk
from edge_agent.nodes.moments import Moments
from edge_agent.uplink.desk import Tell, Told
from metaros._proto import link_pb2
from metaros.clock import boot_s
from metaros.errors import MetarosError

__all__ = ["NodeLink"]

LOG = logging.getLogger("metaros.agent.nodes")


class NodeLink:
    """Takes NodeLeases frames and answers each; `actions` are for the agent's commands."""

    def __init__(self, desk: NodeDesk, *, lease_s: Callable[[], float] = boot_s) -> None:
        self.desk = desk
        self.frames = frozenset({"node_leases"})
        self._lease_s = lease_s
        self._tell: Tell = _nobody
        self._moments = Moments()
        self._newest: tuple[list[link_pb2.NodeLease], float] | None = None
        self._held = False
        self._came = asyncio.Event()

    @property
    def actions(self) -> Mapping[str, Action]:
        """By their names in `Command.action`."""
        return {"node_verb": self._verb, "read_log": self._read_log}

    def link_up(self, tell: Tell, welcome: link_pb2.Welcome) -> None:
        """The gateway asks; what was told over another link gives no lease over this one."""
        self._tell = tell
        self._moments.forget()

    def link_down(self) -> None:
        """The leases run out by themselves, unless the link is back in time."""
        self._tell = _nobody
        self._moments.forget()

    def take(self, told: Told) -> None:
        """The leases that are held now, from a moment that we told over this link; and an answer with another one."""
        frame = told.frame.node_leases
        moment = link_pb2.LeasesTaken(boot_ns=self._moments.tell(round(self._lease_s() * 1e9)))
        self._tell(link_pb2.AgentFrame(leases_taken=moment))
        leases = list(frame.leases)
        if self._moments.knows(frame.since_ns) and (leases or self._held):
            self._held = bool(leases)
            self._newest = (leases, frame.since_ns / 1e9)
            self._came.set()

    async def run(self) -> None:
        """Run the desk, and hand leases to the supervisor, for ever."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.desk.run())
            group.create_task(self._hand_over())

    async def _hand_over(self) -> None:
        while True:
            await self._came.wait()
            self._came.clear()
            if self._newest is None:
                continue
            leases, at_s = self._newest
            try:
                await self.desk.leases(leases, at_s=at_s)
            except MetarosError as error:
                if leases:
                    LOG.warning("leases: %s", error)

    async def _verb(self, command: link_pb2.Command, remaining_s: float) -> bytes:
        what = command.node_verb
        return await self.desk.verb(what.node, what.verb, what.signal, timeout_s=max(remaining_s, 0.1))

    async def _read_log(self, command: link_pb2.Command, remaining_s: float) -> bytes:
        what = command.read_log
        return await self.desk.read_log(
            what.node, cursor=what.cursor, max_bytes=what.max_bytes, query=what.query, backwards=what.backwards
        )


def _nobody(frame: link_pb2.AgentFrame) -> None:
    """There is no link."""
