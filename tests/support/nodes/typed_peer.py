"""A node with types that nobody else in this process knows: it tells them as ROS 2's rcl does, or lies about them."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import pytest

import metaros
from metaros.idl import Catalogue, default_catalogue, known, message_class, parse_definition, type_hash
from metaros.interfaces.type_description_interfaces.srv import GetTypeDescription
from metaros.node import Node
from metaros.node.introspection.type_description import describe

__all__ = ["TypedPeer", "catalogue_with", "typed_peer"]

ACTION_PARTS = ("_SendGoal", "_GetResult", "_FeedbackMessage")


def catalogue_with(texts: Mapping[str, str]) -> Catalogue:
    """Definitions of a peer alone."""
    made = Catalogue(base=default_catalogue())
    made.add_all([parse_definition(text, name) for name, text in texts.items()])
    return made


class TypedPeer:
    """The node, `.types` by name, and what it is asked for in `.asked`.

    It answers by the hash alone, for what its endpoints use and of an action only for the parts, as ROS 2 Jazzy does;
    `whole` has it tell actions, too. `lie` are other definitions that it tells under the hashes of its own.
    """

    def __init__(self, node: Node, catalogue: Catalogue, *, lie: Catalogue | None, sources: bool, whole: bool) -> None:
        self.node, self.catalogue = node, catalogue
        self.asked: list[tuple[str, str]] = []
        self._lie, self._sources, self._whole = lie or catalogue, sources, whole
        self._told: dict[str, str] = {}
        node.create_service(GetTypeDescription, "~/get_type_description", self._tell)

    def type(self, name: str) -> Any:
        """A class of its own, which it tells from now on."""
        for part in ACTION_PARTS if "/action/" in name else ("",):
            self._told[type_hash(name + part, self.catalogue)] = name + part
        if "/action/" in name and self._whole:
            self._told[type_hash(name, self.catalogue)] = name
        return message_class(name, self.catalogue)

    def _tell(self, request: Any, response: Any) -> None:
        self.asked.append((request.type_name, request.type_hash))
        name = self._told.get(request.type_hash)
        if name is None:
            response.failure_reason = "Type not currently in use by this node"
            return
        describe(name, self._lie, response, sources=self._sources and request.include_type_sources)


@contextmanager
def typed_peer(
    context: metaros.Context,
    name: str,
    texts: Mapping[str, str],
    make: Callable[[TypedPeer], object],
    monkeypatch: pytest.MonkeyPatch,
    *,
    lie: Mapping[str, str] | None = None,
    sources: bool = True,
    whole: bool = False,
    namespace: str = "/",
) -> Iterator[TypedPeer]:
    """The peer, spun on a thread once `make(peer)` has given it endpoints; this process forgets their types."""
    with metaros.Node(name, namespace=namespace, context=context, enable_parameters=False) as node:
        told = None if lie is None else catalogue_with({**texts, **lie})
        peer = TypedPeer(node, catalogue_with(texts), lie=told, sources=sources, whole=whole)
        make(peer)
        monkeypatch.setattr(known, "_known", OrderedDict())
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        try:
            yield peer
        finally:
            executor.shutdown()
            thread.join()
