"""Discovery of custom service types: asked of the robot's nodes, sent to the gateway with the graph."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable, Mapping
from typing import Final

from edge_agent.ros.graph_snapshot import GraphEndpoint
from metaros._proto import link_pb2
from metaros.errors import MetarosError
from metaros.idl import Catalogue, MessageDefinition, catalogue_of, default_catalogue, definition_text
from metaros.idl.derived import root_names
from metaros.limits import LIMITS, Limits
from metaros.link.parse_cost import parse_cost
from metaros.node import Node
from metaros.node.introspection import fetch_type_async

__all__ = ["ServiceTypeDiscovery", "type_text"]

LOG = logging.getLogger("metaros.agent.types")
PAUSES_S: Final = (0.0, 5.0, 30.0)  # before each try: a node that has just started may not answer yet
AT_ONCE: Final = 4
Key = tuple[str, str]


class ServiceTypeDiscovery:
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
        """See to it that the types of these services become known; each is asked for once."""
        shipped = default_catalogue()
        for endpoint in endpoints:
            key = (endpoint.type_name, endpoint.type_hash)
            new = (
                endpoint.kind == link_pb2.ENDPOINT_KIND_SERVER
                and "/srv/" in endpoint.type_name
                and key not in self._asked
            )
            if not new or catalogue_of(*key) is shipped or len(self._asked) >= self._limits.graph_types:
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
        LOG.warning("services of type %s can only be called remotely in CDR: %s", key[0], reason)


def type_text(key: Key, catalogue: Catalogue) -> link_pb2.TypeText:
    """A type with its parts, but for those that everybody has."""
    shipped = default_catalogue()
    text = link_pb2.TypeText(type_name=key[0], type_hash=key[1])
    for name in (key[0], *catalogue.dependencies(key[0])):
        definition = catalogue.get(name)
        derived = isinstance(definition, MessageDefinition) and any(root in catalogue for root in root_names(name))
        if derived or (name in shipped and shipped.get(name) == definition):
            continue
        text.parts.add(name=name, text=definition_text(definition))
    return text
