"""The second key of an endpoint: for peers of ROS 2 Humble, which write no type hash, or for those that do.

An endpoint that writes its type's hash has its twin under `TypeHashNotSupported`; one that writes none, because the
program says that it is of Humble, has it under the hash. It is opened when such a peer is there, and then stays.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import zenoh

from metaros.errors import ClosedError
from metaros.idl import default_catalogue
from metaros.idl import type_hash as hash_of
from metaros.wire import DataKey
from metaros.wire.liveliness_tokens import EndpointToken
from metaros.wire.matching import is_counterpart
from metaros.wire.names import NO_HASH

__all__ = ["TwinKey", "other_hash"]


def other_hash(type_name: str, type_hash: str, declared: str) -> str:
    """The hash that peers of the other kind write for a type; "" where it is not known."""
    if declared != NO_HASH:
        return NO_HASH
    if type_hash != NO_HASH:
        return type_hash
    return hash_of(type_name) if type_name in default_catalogue() else ""


class TwinKey:
    """Observes the peers of one endpoint, as an `EndpointMonitor` does. Thread-safe.

    `open_twin(key)` is called once, when there is reason to. `present(others)` is told when the first peer of the other
    kind comes to this very name, and when the last one goes.
    """

    def __init__(
        self,
        token: EndpointToken,
        twin_hash: str,
        *,
        open_twin: Callable[[str], None],
        present: Callable[[bool], None] | None = None,
    ) -> None:
        self._token = token
        self._hash = twin_hash
        self.key = str(DataKey(token.node.domain, token.topic, token.type_name, twin_hash))
        self._open, self._present = open_twin, present
        self._lock = threading.RLock()
        self.opened = self._closed = False
        self._others: set[EndpointToken] = set()
        self._own: dict[EndpointToken, bytes] = {}  # peers of our own kind, which are heard on both keys
        self._own_gids: set[bytes] = set()

    def open(self) -> None:
        """Open it, unless it is."""
        with self._lock:
            if self.opened or self._closed:
                return
            self.opened = True
            try:
                self._open(self.key)
            except (ClosedError, zenoh.ZError):  # the session goes
                self._closed = True

    def came(self, token: EndpointToken) -> None:
        """A token is in the graph."""
        if not is_counterpart(self._token, token) or token.type_name != self._token.type_name:
            return
        with self._lock:
            if token.type_hash != self._hash:
                self._own[token] = token.gid
                self._own_gids = set(self._own.values())
                return
            first = not self._others
            self._others.add(token)
            self.open()
            if first and self._present is not None and not self._closed:
                self._present(True)

    def went(self, token: EndpointToken) -> None:
        """A token left the graph."""
        with self._lock:
            if self._own.pop(token, None) is not None:
                self._own_gids = set(self._own.values())
            if token in self._others:
                self._others.discard(token)
                if not self._others and self._present is not None and not self._closed:
                    self._present(False)

    def known(self) -> list[EndpointToken]:
        """The peers that are taken to be in the graph."""
        with self._lock:
            return [*self._others, *self._own]

    def close(self) -> None:
        """Open and tell nothing more."""
        with self._lock:
            self._closed = True

    def accepts(self, sample: zenoh.Sample) -> bool:
        """Whether what came on the twin key is of a peer of the other kind: ours are heard on the first key, too."""
        attachment: Any = sample.attachment
        return attachment is None or attachment.to_bytes()[-16:] not in self._own_gids

    def pass_on(self, sink: Callable[[zenoh.Sample], object]) -> Callable[[zenoh.Sample], None]:
        """`sink` for what `accepts` takes. Python code on Zenoh's thread, so of remote samples only."""
        accepts = self.accepts

        def put(sample: zenoh.Sample) -> None:
            if accepts(sample):
                sink(sample)

        return put
