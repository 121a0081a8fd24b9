"""From a sample in its mailbox to the user's callback: checks, decoding, loss counters."""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable
from typing import Any, Final

import zenoh

from metaros.clock import Clock
from metaros.errors import PeerError, TooLargeError
from metaros.limits import LIMITS
from metaros.node.info import MessageInfo
from metaros.wire.attachment import NEW, Attachment, parse_attachment
from metaros.wire.shm import intact

__all__ = ["Receiver"]

_log = logging.getLogger("metaros.node")
_PUBLISHERS: Final = 1024  # publishers whose sequence is followed at a time, on one subscription


class Receiver:
    """Checks, decodes and hands over samples; counts what was lost on the way and what could not be read.

    `handle(sample)` never raises: a peer's faults are counted in `malformed` and reported through
    `report(about, text)`, the callback's own exceptions are logged, unless `raises` lets them through. `dropped()` is
    how many samples were pushed out before they came here; a gap that they do not explain is reported to
    `on_lost(total, change, gid)`.
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
        on_lost: Callable[[int, int, bytes], object],
        dropped: Callable[[], int],
        raises: bool = False,
    ) -> None:
        self.lost = 0
        self.malformed = 0
        self.two_keys = False  # whether a publisher may be heard twice, on the twin key, too
        self._on_lost = on_lost
        self._dropped = dropped
        self._dropped_seen = 0  # of what the mailbox dropped: gaps that are explained
        self._next: dict[bytes, int] = {}  # by publisher: the sequence number that comes next
        self._name = name
        self._report = report
        self._callback = callback
        self._with_info = with_info
        self._clock = clock
        self._accept: Callable[[MessageInfo], bool] | None = None
        self._raises = raises
        self.handle, self._call_instead = self._handler(decode, callback, clock if with_info else None)

    def inspect(self, accept: Callable[[MessageInfo], bool]) -> None:
        """From now on let the callback have only what `accept(info)` takes. Without it nothing is asked."""
        self._accept = accept
        callback, with_info = self._callback, self._with_info

        def inspected(message: Any, info: MessageInfo | None = None) -> Any:
            if info is None:
                return callback(message)
            if not accept(info):
                return None
            return callback(message, info) if with_info else callback(message)

        self._call_instead(inspected, self._clock)

    def replace(self, callback: Callable[..., Any], *, with_info: bool) -> None:
        """Call this one from now on."""
        self._callback, self._with_info = callback, with_info
        if self._accept is None:
            self._call_instead(callback, self._clock if with_info else None)
        else:
            self.inspect(self._accept)

    def _handler(
        self, decode: Callable[[bytes], Any], callback: Callable[..., Any], clock: Clock | None
    ) -> tuple[Callable[[zenoh.Sample], Any], Callable[[Callable[..., Any], Clock | None], None]]:
        """The hot path as a closure, and how to give it another callback; everything unusual is left to methods."""
        expected, unpack, large = self._next, NEW.unpack, LIMITS.shared_memory_threshold_bytes
        raises = self._raises
        newest, following = b"", 0  # the publisher heard last and the number it has next: most often the same again

        def handle(sample: zenoh.Sample) -> Any:
            nonlocal newest, following
            gid = b""
            try:
                try:
                    seq, source_ns, gid = unpack(sample.attachment.to_bytes())  # type: ignore[union-attr]
                except (AttributeError, struct.error):  # there is none, or of another form
                    seq, source_ns, gid = _attachment(sample)
                if seq == following and gid == newest and source_ns >= 0:
                    following += 1
                else:
                    if newest:
                        expected[newest] = following
                    following = self._follow(seq, source_ns, gid, sample)
                    newest = gid
                payload = sample.payload.to_bytes()
                if len(payload) >= large and not self._sound(sample, len(payload), gid):
                    return None
                message = decode(payload)
            except PeerError as error:
                return self._reject(gid, error)
            try:
                if clock is None:
                    return callback(message)
                return callback(message, MessageInfo(source_ns, clock.wall_ns(), seq, gid))
            except Exception:
                if raises:
                    raise
                _log.exception("the callback of %s failed", self._name)
                return None

        def call_instead(new_callback: Callable[..., Any], new_clock: Clock | None) -> None:
            nonlocal callback, clock
            callback = new_callback  # first: it does without the info that samples under way do not bring yet
            clock = new_clock

        return handle, call_instead

    def _follow(self, seq: int, source_ns: int, gid: bytes, sample: zenoh.Sample) -> int:
        """A sample of another publisher than the last one's, or not its next: check it, count the gap.

        Returns which number the publisher has next.
        """
        expected = self._next.get(gid)
        if expected == seq and source_ns >= 0:
            return seq + 1
        _attachment(sample)
        if expected is None:
            if len(self._next) >= _PUBLISHERS:
                del self._next[next(iter(self._next))]
            self._dropped_seen = self._dropped()
        elif seq > expected:
            self._gap(seq - expected, gid)
        elif seq < expected:  # late or repeated: it was counted as lost, or seen before
            if self.two_keys:
                raise _HeardBeforeError
            return expected
        self._next[gid] = seq + 1
        return seq + 1

    def _gap(self, count: int, gid: bytes) -> None:
        """So many samples are missing; those that our own history pushed out are not lost."""
        own = min(count, self._dropped() - self._dropped_seen)
        self._dropped_seen += own
        if count > own:
            self.lost += count - own
            self._on_lost(self.lost, count - own, gid)

    def _sound(self, sample: zenoh.Sample, size_bytes: int, gid: bytes) -> bool:
        """Whether a large payload may be read: not too large, and, if shared, not taken back before it was copied."""
        if size_bytes > LIMITS.sample_bytes:
            raise TooLargeError(f"a message of {size_bytes} bytes: the limit is {LIMITS.sample_bytes}")
        if intact(sample.payload):
            return True
        self.lost += 1
        self._on_lost(self.lost, 1, gid)
        return False

    def _reject(self, gid: bytes, error: PeerError) -> None:
        if isinstance(error, _HeardBeforeError):
            return
        self.malformed += 1
        sender = f"publisher {gid.hex()}" if gid else "a publisher"
        self._report(f"{error.code} {gid.hex()}", f"{sender} sent what cannot be read: {error.code}: {error}")


class _HeardBeforeError(PeerError):
    """A sample that came by the other key, too: no fault of anybody's."""


def _attachment(sample: zenoh.Sample) -> Attachment:
    """The sample's attachment in whichever form; AttachmentError where it is missing or not sound."""
    attachment = sample.attachment
    return parse_attachment(b"" if attachment is None else attachment.to_bytes())
