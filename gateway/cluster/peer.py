"""A peer: one process of another gateway."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

from gateway.cluster.handshake import Handshake
from gateway.cluster.keys import MeshKeys, Process
from gateway.cluster.seal import TAG_BYTES, Opener, Sealer
from gateway.cluster.wire import Joiner, Kind, Message, pieces

__all__ = ["Peer"]


class Peer:
    """`meeting` is the event loop's, `taken` the receiving thread's, and what `sending` gives the sending thread's."""

    def __init__(self, process: Process, own: Process, keys: MeshKeys, *, inbox: str, most_bytes: int) -> None:
        self.process = process
        self.gateway = process.gateway
        self.meeting = Handshake()
        self.proof = ""  # by which its token is told from others of its name; the event loop's
        self._own = own
        self._inbox = inbox
        self._most_bytes = most_bytes
        self._lock = threading.Lock()
        self._queued_bytes = 0
        self._sealer = Sealer(own.boot, keys.between(own, process))
        self._opener = Opener(keys.between(process, own))
        self._joiner = Joiner()

    def rekey(self, keys: MeshKeys) -> None:
        """Other keys seal and open from now on."""
        self._sealer.use(keys.between(self._own, self.process))
        self._opener.use(keys.between(self.process, self._own))

    @property
    def queued_bytes(self) -> int:
        """What waits for it."""
        return self._queued_bytes

    def sending(self, message: Message, *, bounded: bool = True) -> Callable[[], Iterator[tuple[str, bytes]]] | None:
        """What the sending thread is to do for a message; None: too much waits already."""
        size = len(message.payload) + TAG_BYTES
        with self._lock:
            if bounded and self._queued_bytes + size > self._most_bytes:
                return None
            self._queued_bytes += size

        def frames() -> Iterator[tuple[str, bytes]]:
            try:
                if message.kind is Kind.HELLO or message.mine == self.meeting.mine:  # else it was lost meanwhile
                    for piece in pieces(message):
                        yield self._inbox, self._sealer.seal(piece)
            finally:
                with self._lock:
                    self._queued_bytes -= size

        return frames

    def taken(self, frame: bytes) -> tuple[Message | None, bool]:
        """The message that a frame of its completes, and whether something before it is missing.

        Raises:
            ForgedError: it is not this process's to this one, or it came before.
            ValueError: it is sealed well, and no message: a mistake of ours, or another version's.
        """
        plain, missing = self._opener.open(frame)
        if missing:
            self._joiner.drop()
        return self._joiner.take(plain), missing
