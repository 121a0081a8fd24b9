"""Sampled tracing: one sample in many carries the times when it was tapped, taken, stored and sent (`SampleTrace`).

The others cost a decrement each. A chosen sample is known again by its stream and stamp, so that outbox and queues
carry nothing more; of a stream one at a time is followed. Everything here is on the event loop.
"""

from __future__ import annotations

import random  # noqa: TID251 - the type only; the generator is an argument
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.link import CHANNEL_MASK

__all__ = ["Tracer"]

_FOLLOWED: Final = 64  # streams of which a sample is on its way; no other is chosen meanwhile
_FORGET_S: Final = 60.0  # it was dropped, or the link has been down for so long
_PER_S: Final = 10.0  # samples that are chosen, at most


@dataclass(slots=True)
class _Mark:
    """A chosen sample, with the robot's wall clock at each place."""

    stamp_ns: int
    tapped_ns: int
    taken_ns: int
    since_s: float
    accepted_ns: int = 0


class Tracer:
    """`every` = 0 follows none. `clock_offset_ns` says how far the gateway's wall clock is before the robot's."""

    def __init__(self, clock: Clock, rng: random.Random, *, every: int) -> None:
        self._clock = clock
        self._rng = rng
        self._every = every
        self._left = 1  # the first one at once, so that who looks sees something
        self._next_s = 0.0
        self._marks: dict[int, _Mark] = {}
        self.clock_offset_ns: Callable[[], int | None] = lambda: None

    def taken(self, channel_id: int, stamp_ns: int, arrived_s: float) -> None:
        """A sample was given to the outbox or to the live queue; perhaps it is the one."""
        self._left -= 1
        if self._left > 0 or not self._every:
            return
        self._left = max(1, self._every // 10)  # if it cannot be this one
        now_s = self._clock.monotonic_s()
        if now_s < self._next_s:
            return
        self._marks = {key: mark for key, mark in self._marks.items() if now_s - mark.since_s < _FORGET_S}
        if channel_id in self._marks or len(self._marks) >= _FOLLOWED:
            return
        self._left, self._next_s, wall_ns = self._every, now_s + 1 / _PER_S, self._clock.wall_ns()
        tapped_ns = wall_ns - round((now_s - arrived_s) * 1e9)
        self._marks[channel_id] = _Mark(stamp_ns, tapped_ns, wall_ns, now_s)

    def accepted(self, streams: Mapping[int, Sequence[Any]]) -> None:
        """What was gathered of these streams, as (stamp, payload), is on the disk."""
        if not self._marks:
            return
        for stream_id, items in streams.items():
            mark = self._marks.get(stream_id & CHANNEL_MASK)
            if mark is not None and any(isinstance(item, tuple) and item[0] == mark.stamp_ns for item in items):
                mark.accepted_ns = self._clock.wall_ns()

    def follows(self, stream_id: int) -> bool:
        """Whether a sample of the stream is on its way."""
        return stream_id & CHANNEL_MASK in self._marks

    def sent(self, stream_id: int, first_seq: int, stamps: bytes) -> bytes:
        """What a batch of these stamps carries more: a serialised Batch with the trace alone, or nothing.

        Protocol Buffers read a message's pieces one after the other as one.
        """
        mark = self._marks.get(stream_id & CHANNEL_MASK)
        if mark is None:
            return b""
        found = struct.unpack(f"<{len(stamps) // 8}q", stamps)
        if mark.stamp_ns not in found:
            return b""
        del self._marks[stream_id & CHANNEL_MASK]
        trace = link_pb2.SampleTrace(
            seq=first_seq + found.index(mark.stamp_ns),
            traceparent=f"00-{self._rng.getrandbits(128) or 1:032x}-{self._rng.getrandbits(64) or 1:016x}-01",
            tapped_ns=mark.tapped_ns,
            taken_ns=mark.taken_ns,
            accepted_ns=mark.accepted_ns,
            sent_ns=self._clock.wall_ns(),
            clock_offset_ns=self.clock_offset_ns() or 0,
        )
        return link_pb2.Batch(trace=trace).SerializeToString()
