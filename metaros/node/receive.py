"""What happens to one sample between its mailbox and the user's callback."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Final

import zenoh

from metaros.clock import Clock
from metaros.errors import PeerError, TooLargeError
from metaros.limits import LIMITS
from metaros.node.info import MessageInfo
from metaros.wire.attachment import NEW, parse_attachment

__all__ = ["Receiver"]

_log = logging.getLogger("metaros.node")
_PUBLISHERS: Final = 1024  # publishers whose sequence is followed at a time, on one subscription


class Receiver:
    """Checks, decodes and hands over samples; counts what was lost on the way and what could not be read.

    `handle(sample)` never raises: a peer's faults are counted in `malformed` and reported through
    `report(about, text)`, the callback's own exceptions are logged.
    """

    def __init__(
        self,
        *,
        decode: Callable[[bytes], Any],
        callback: Callable[..., Any],
        with_info: bool,
        clock: Clock,
        name: str,
        report: Callable[[str, str], object],
    ) -> None:
        self.lost = 0
        self.malformed = 0
        self._next: dict[bytes, int] = {}  # by publisher: the sequence number that comes next
        self._name = name
        self._report = report
        self.handle = self._handler(decode, callback, clock if with_info else None)

    def _handler(
        self, decode: Callable[[bytes], Any], callback: Callable[..., Any], clock: Clock | None
    ) -> Callable[[zenoh.Sample], Any]:
        """The hot path as a closure; everything unusual is left to methods."""
        expected, unpack, size, limit = self._next, NEW.unpack, NEW.size, LIMITS.sample_bytes

        def handle(sample: zenoh.Sample) -> Any:
            gid = b""
            try:
                attachment = sample.attachment
                data = b"" if attachment is None else attachment.to_bytes()
                seq, source_ns, gid = unpack(data) if len(data) == size else parse_attachment(data)
                if expected.get(gid) == seq and source_ns >= 0:
                    expected[gid] = seq + 1
                else:
                    self._follow(seq, gid, data)
                payload = sample.payload.to_bytes()
                if len(payload) > limit:
                    raise TooLargeError(f"a message of {len(payload)} bytes: the limit is {limit}")
                message = decode(payload)
            except PeerError as error:
                return self._reject(gid, error)
            try:
                if clock is None:
                    return callback(message)
                return callback(message, MessageInfo(source_ns, clock.wall_ns(), seq, gid))
            except Exception:
                _log.exception("the callback of %s failed", self._name)
                return None

        return handle

    def _follow(self, seq: int, gid: bytes, data: bytes) -> None:
        """A first sample, or one that is not the next: check it fully, count the gap."""
        parse_attachment(data)
        expected = self._next.get(gid)
        if expected is None:
            if len(self._next) >= _PUBLISHERS:
                del self._next[next(iter(self._next))]
        elif seq > expected:
            self.lost += seq - expected
        elif seq < expected:  # late or repeated: it was counted as lost, or seen before
            return
        self._next[gid] = seq + 1

    def _reject(self, gid: bytes, error: PeerError) -> None:
        self.malformed += 1
        sender = f"publisher {gid.hex()}" if gid else "a publisher"
        self._report(f"{error.code} {gid.hex()}", f"{sender} sent what cannot be read: {error.code}: {error}")
