"""Discovery of custom types of services, actions and subscriptions: asked of nodes, sent to the gateway with the graph.

Topics that somebody publishes have their types with their channels; what is only listened to has it here.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable, Mapping
from typing import Final

from edge_agent.ros.graph_snapshot import GraphEndpoint
from metaros._proto import link_pb2
from metaros.errors import MetarosError
from metaros.idl import Catalogue, definition_text, type_hash
from metaros.idl.catalogue import shipped_catalogue
from metaros.idl.derived import root_names
from metaros.limits import LIMITS, Limits
from metaros.link.parse_cost import parse_cost
from metaros.node import Node
from metaros.node.introspection import fetch_type_async
from metaros.wire.names import NO_HASH

__all__ = ["GraphTypeDiscovery", "type_text"]

LOG = logging.getLogger("metaros.agent.types")
PAUSES_S: Final = (0.0, 5.0, 30.0)  # before each try: a node that has just started may not answer yet
AT_ONCE: Final = 4
SEND_GOAL: Final = "_SendGoal"  # an action goes by the name and hash of this service of it
Key = tuple[str, str]


class GraphTypeDiscovery:
    """`texts` grows as nodes answer; `learned` is called then. On the event loop."""

    def __init__(self, node: Node, learned: Callable[[], None], *, limits: Limits = LIMITS) -> None:
        self._node = node
        self._learned = learned
        self._limits = limits
        self._asked: set[Key] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._turns = asyncio.Semaphore(AT_ONCE)
        self._texts: dict[Key, link_pb2.TypeText] = {}

    @property
    def texts(self) -> Mapping[Key, link_pb2.TypeText]:
        """What is known by now, by name and hash."""
        return self._texts

    def look(self, endpoints: Iterable[GraphEndpoint]) -> None:
        """See to it that the types of these become known; each is asked for once."""
        for endpoint in endpoints:
            key = (endpoint.type_name, endpoint.type_hash)
            new = _matters(endpoint) and key not in self._asked
            if not new or _everybody_has(key) or len(self._asked) >= self._limits.graph_types:
                continue
            self._asked.add(key)
            task = asyncio.get_running_loop().create_task(self._learn(key))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        """Ask no more."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _learn(self, key: Key) -> None:
        reason = ""
        for pause_s in PAUSES_S:
            await asyncio.sleep(pause_s)
            try:
                async with self._turns:
                    text = type_text(key, await fetch_type_async(self._node, *key))
            except MetarosError as error:
                reason = str(error)
                continue
            if parse_cost(text, enough=self._limits.graph_type_steps) <= self._limits.graph_type_steps:
                self._texts[key] = text
                self._learned()
                return
            reason = "its definition is too large"
            break
        LOG.warning("what is of type %s can only be used remotely in CDR: %s", key[0].removesuffix(SEND_GOAL), reason)


def _matters(endpoint: GraphEndpoint) -> bool:
    """Whether clients of a gateway send what is of that type: requests, goals, and messages that somebody hears."""
    name = endpoint.type_name
    if endpoint.kind == link_pb2.ENDPOINT_KIND_SERVER:
        return "/srv/" in name or ("/action/" in name and name.endswith(SEND_GOAL))
    return endpoint.kind == link_pb2.ENDPOINT_KIND_SUBSCRIPTION and "/msg/" in name and endpoint.type_hash != NO_HASH


def _everybody_has(key: Key) -> bool:
    """Whether the gateway has it: not what folders of this robot add."""
    name, hash_text = key
    return name in shipped_catalogue() and hash_text in (NO_HASH, type_hash(name, shipped_catalogue()))


def type_text(key: Key, catalogue: Catalogue) -> link_pb2.TypeText:
    """A type with its parts, but for those that everybody has; of an action all of it."""
    shipped, root = shipped_catalogue(), key[0].removesuffix(SEND_GOAL)
    text = link_pb2.TypeText(type_name=key[0], type_hash=key[1])
    for name in (root, *catalogue.dependencies(root)):
        definition = catalogue.get(name)
        derived = any(whole in catalogue for whole in root_names(name))
        if derived or (name in shipped and shipped.get(name) == definition):
            continue
        text.parts.add(name=name, text=definition_text(definition))
    return text
