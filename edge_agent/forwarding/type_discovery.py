"""Types that the agent has never seen: it asks the nodes that publish them, so that the gateway can decode."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence

from edge_agent.forwarding.channels import Channel
from metaros.errors import MetarosError
from metaros.idl import Catalogue
from metaros.node import Node
from metaros.node.introspection import fetch_type_async
from metaros.wire import EndpointInfo

__all__ = ["TypeDiscovery"]

LOG = logging.getLogger("metaros.agent.learn")
PAUSES_S = (0.0, 5.0, 30.0)  # before each try: a node that has just started may not answer yet
AT_ONCE = 8


class TypeDiscovery:
    """One conversation a type and set of publishers; on the event loop. `learned` gets what came of it."""

    def __init__(self, node: Node, learned: Callable[[Channel, Catalogue], None]) -> None:
        self._node = node
        self._learned = learned
        self._asked: dict[int, frozenset[bytes]] = {}  # channel → the publishers that were there
        self._tasks: set[asyncio.Task[None]] = set()
        self._turns = asyncio.Semaphore(AT_ONCE)

    def ask(self, channel: Channel, publishers: Sequence[EndpointInfo]) -> None:
        """See to it that the channel's type becomes known; nothing if these publishers were asked before."""
        there = frozenset(publisher.gid for publisher in publishers)
        if channel.schema or not there or there <= self._asked.get(channel.channel_id, frozenset()):
            return
        self._asked[channel.channel_id] = there
        task = asyncio.get_running_loop().create_task(self._learn(channel))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def close(self) -> None:
        """Stop asking."""
        for task in self._tasks:
            task.cancel()

    async def _learn(self, channel: Channel) -> None:
        reason = ""
        for pause_s in PAUSES_S:
            await asyncio.sleep(pause_s)
            if channel.schema:
                return
            try:
                async with self._turns:
                    catalogue = await fetch_type_async(self._node, channel.type_name, channel.type_hash)
            except MetarosError as error:
                reason = str(error)
            else:
                self._learned(channel, catalogue)
                return
        LOG.warning("%s goes out without a schema: %s", channel.topic, reason)
