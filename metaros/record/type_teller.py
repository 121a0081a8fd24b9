"""What a recording has of types that nobody else may know, told to whoever asks the node that plays them."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from contextlib import suppress
from typing import Protocol

from metaros.errors import MetarosError
from metaros.executor import SingleThreadedExecutor
from metaros.idl import Catalogue, add_schema_text, default_catalogue, remember
from metaros.idl.catalogue import shipped_catalogue
from metaros.node import Node
from metaros.node.introspection import offer_type_description

__all__ = ["TypeTeller", "recorded_catalogue"]


class RecordedTopic(Protocol):
    """A topic of a recording."""

    @property
    def type_name(self) -> str:
        """Such as std_msgs/msg/String."""

    @property
    def type_hash(self) -> str:
        """As recorded, "" where it was not."""

    @property
    def schema(self) -> str:
        """The ros2msg text, "" where there is none."""


def recorded_catalogue(topic: RecordedTopic) -> Catalogue:
    """The catalogue with a topic's type as its schema says; DefinitionError where that is none."""
    catalogue = Catalogue(base=default_catalogue())
    if topic.schema:
        add_schema_text(topic.type_name, topic.schema, catalogue)
    return catalogue.home(topic.type_name)


class TypeTeller:
    """Offers `~/get_type_description` on a node that nobody spins, where a recording has types of its own."""

    def __init__(self, node: Node, topics: Iterable[RecordedTopic]) -> None:
        self._executor: SingleThreadedExecutor | None = None
        if not any(map(_learned, topics)):
            return
        offer_type_description(node)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin, name="metaros-player-types", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Tell nothing any more. Safe to call twice."""
        executor, self._executor = self._executor, None
        if executor is not None:
            executor.shutdown()
            self._thread.join()


def _learned(topic: RecordedTopic) -> bool:
    """Whether it is a type that not every program has; it is known here from now on."""
    if not topic.schema:
        return False
    with suppress(MetarosError):  # it is played all the same
        catalogue = recorded_catalogue(topic)
        if catalogue is not default_catalogue() or topic.type_name not in shipped_catalogue():
            remember(topic.type_name, catalogue, hash_text=topic.type_hash)
            return True
    return False
