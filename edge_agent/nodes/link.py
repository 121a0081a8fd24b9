"""The nodes' desk on the link: leases of migratable nodes, and the commands about nodes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

from edge_agent.commands import Action
from edge_agent.nodes.desk import NodeDesk
from edge_agent.uplink.desk import Tell, Told
from metaros._proto import link_pb2
from metaros.clock import Clock, boot_s
from metaros.errors import MetarosError

__all__ = ["NodeLink"]

LOG = logging.getLogger("metaros.agent.nodes")


class NodeLink:
    """Takes NodeLeases frames, newest first; `actions` are for the agent's commands."""

    def __init__(self, desk: NodeDesk, clock: Clock, *, lease_s: Callable[[], float] = boot_s) -> None:
        self.desk = desk
        self.frames = frozenset({"node_leases"})
        self._clock = clock
        self._lease_s = lease_s
        self._newest: tuple[list[tuple[str, str, float]], float] | None = None
        self._came = asyncio.Event()

    @property
    def actions(self) -> Mapping[str, Action]:
        """By their names in `Command.action`."""
        return {"node_verb": self._verb, "read_log": self._read_log}

    def link_up(self, tell: Tell, welcome: link_pb2.Welcome) -> None:
        """Nothing: the gateway gives leases when it has heard of us."""

    def link_down(self) -> None:
        """Nothing: the leases run out by themselves, unless the link is back in time."""

    def take(self, told: Told) -> None:
        """The leases that are held now. A frame whose age nobody knows could be any old: it is left out."""
        if told.age_s is None:
            LOG.warning("leases of unknown age: left out")
            return
        age_s = max(told.age_s, 0.0) + max(self._clock.monotonic_s() - told.arrived_s, 0.0)
        leases = [(one.node, one.lease_id, one.valid_ms / 1000) for one in told.frame.node_leases.leases]
        at_s = self._lease_s() - age_s
        if self._newest is not None and at_s < self._newest[1]:
            return
        self._newest = (leases, at_s)
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
