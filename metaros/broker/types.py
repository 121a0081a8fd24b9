"""Message classes for what the graph names; a type never seen before is asked of the nodes that use it."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable
from queue import SimpleQueue
from typing import Any

from metaros.broker.faults import Faults
from metaros.errors import MetarosError
from metaros.idl import catalogue_of, message_class
from metaros.node import Node
from metaros.node.introspection import fetch_type
from metaros.wire import EndpointInfo

__all__ = ["Types"]

_log = logging.getLogger("metaros.broker")
_TRIES = 3  # a node that does not answer is asked again when the graph has changed


class Types:
    """Finds classes; asks for unknown ones on a thread of its own, and calls `changed()` after each answer."""

    def __init__(self, node: Node, *, changed: Callable[[], None], faults: Faults) -> None:
        self._node = node
        self._changed = changed
        self._faults = faults
        self._pending: set[tuple[str, str]] = set()
        self._tries: dict[tuple[str, str], int] = {}
        self._questions: SimpleQueue[tuple[str, str] | None] = SimpleQueue()
        self._thread: threading.Thread | None = None

    def find(self, item: EndpointInfo) -> type[Any] | None:
        """The class of an endpoint's type, or None as long as it is not known."""
        key = item.type_name, item.type_hash
        catalogue = catalogue_of(*key)
        if catalogue is not None:
            return _class(item.type_name, catalogue)
        if key not in self._pending and self._tries.get(key, 0) < _TRIES:
            self._ask(key)
        return None

    def classes(self, endpoints: Iterable[EndpointInfo]) -> list[type[Any]]:
        """The known classes of these endpoints, what subscriptions ask for first."""
        ranked = sorted(endpoints, key=lambda item: (item.kind != "MS", item.type_name))
        return list(dict.fromkeys(found for item in ranked if (found := self.find(item)) is not None))

    def pending(self, endpoints: Iterable[EndpointInfo]) -> bool:
        """Whether a type of these endpoints is being asked for now."""
        return any((item.type_name, item.type_hash) in self._pending for item in endpoints)

    def close(self) -> None:
        """End the thread; an unanswered question may take its time, nobody waits for it."""
        self._questions.put(None)

    def _ask(self, key: tuple[str, str]) -> None:
        self._pending.add(key)
        self._tries[key] = self._tries.get(key, 0) + 1
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="metaros-zmq-types", daemon=True)
            self._thread.start()
        self._questions.put(key)

    def _run(self) -> None:
        while (key := self._questions.get()) is not None:
            try:
                fetch_type(self._node, *key)
            except MetarosError as error:
                if not self._node.closed:
                    self._faults.warn_once(key, f"not bridged: {str(error).splitlines()[0]}")
            except Exception:  # the session was closed meanwhile
                if not self._node.closed:
                    _log.exception("asking for %s failed", key[0])
            self._pending.discard(key)
            self._changed()


def _class(name: str, catalogue: Any) -> type[Any] | None:
    """None for what is no message."""
    try:
        found: type[Any] = message_class(name, catalogue)
    except MetarosError:
        return None
    return found if hasattr(found, "__metaros_fields__") else None
