"""The outbox: what was accepted and not yet acknowledged, a bounded queue a stream, in memory.

Sequence numbers start at 1 in a random epoch and have no holes: what the outbox could not keep is a Gap in its place.
Invariant: for every stream, acknowledged seqs, held samples and held gaps make 1..last, disjoint.

Each stream has two queues: what was sent on this session and waits for its ack, and what waits to be sent. A new
session puts the first back in front of the second, from the gateway's watermark on. The class's quota bounds the
bytes of its streams together; the policy says who yields when it is full.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from metaros.clock import Clock
from metaros.errors import FrameError
from metaros.limits import LIMITS

__all__ = ["CLASSES", "ClassPolicy", "Gap", "Held", "Outbox", "Sample", "StreamRange"]

OVERHEAD_BYTES = 128  # what one held sample costs beside its bytes


class Sample(NamedTuple):
    """One held sample; `data` is CDR, or (series id, value) on the metric stream."""

    seq: int
    stamp_ns: int
    data: bytes | tuple[int, float]


class Gap(NamedTuple):
    """Sequence numbers that were accepted and are lost, with the wall time of their loss."""

    from_seq: int
    to_seq: int
    reason: str
    from_ns: int
    to_ns: int


Held = Sample | Gap


class StreamRange(NamedTuple):
    """What a Hello says of a stream."""

    stream_id: int
    first_seq: int
    last_seq: int


@dataclass(frozen=True, slots=True)
class ClassPolicy:
    """A delivery class's quota, and which sample is given up when it is full."""

    quota_bytes: int
    give_up: Literal["oldest", "newest"]


CLASSES: Mapping[str, ClassPolicy] = {
    "event": ClassPolicy(LIMITS.outbox_bytes // 8, "newest"),  # the first events of an outage tell its cause
    "metric": ClassPolicy(LIMITS.outbox_bytes // 8, "oldest"),
    "bulk": ClassPolicy(LIMITS.outbox_bytes * 3 // 4, "oldest"),
}


class _Stream:
    """One stream's numbers and its two queues, each in seq order."""

    __slots__ = ("acked", "delivery", "last_seq", "sent", "stream_id", "unsent")

    def __init__(self, stream_id: int, delivery: str) -> None:
        self.stream_id = stream_id
        self.delivery = delivery
        self.last_seq = 0
        self.acked = 0
        self.sent: deque[Held] = deque()
        self.unsent: deque[Held] = deque()


class Outbox:
    """All streams' queues under the classes' quotas. Not thread-safe: the event loop owns it."""

    def __init__(self, clock: Clock, epoch: int, *, classes: Mapping[str, ClassPolicy] = CLASSES) -> None:
        self.epoch = epoch
        self._clock = clock
        self._classes = dict(classes)
        self._streams: dict[int, _Stream] = {}
        self._bytes = dict.fromkeys(classes, 0)
        self._samples = 0
        self._arrivals: dict[str, deque[tuple[_Stream, int]]] = {name: deque() for name in classes}
        self.lost: dict[int, int] = {}

    @property
    def size_bytes(self) -> int:
        """Bytes held, over all classes."""
        return sum(self._bytes.values())

    @property
    def sample_count(self) -> int:
        """Samples held, over all classes."""
        return self._samples

    def ranges(self) -> list[StreamRange]:
        """Each stream's oldest held and newest accepted number."""
        return [StreamRange(s.stream_id, s.acked + 1, s.last_seq) for s in self._streams.values()]

    def append(self, stream_id: int, delivery: str, stamp_ns: int, data: bytes | tuple[int, float]) -> int:
        """Accept a sample and give it its number; what has to yield for it becomes a Gap."""
        stream = self._stream(stream_id, delivery)
        size = sample_size(data)
        policy = self._classes[delivery]
        if policy.give_up == "newest" and self._bytes[delivery] + size > policy.quota_bytes:
            return self.give_up(stream_id, delivery, "outbox_full")
        stream.last_seq += 1
        stream.unsent.append(Sample(stream.last_seq, stamp_ns, data))
        self._arrivals[delivery].append((stream, stream.last_seq))
        self._bytes[delivery] += size
        self._samples += 1
        while self._bytes[delivery] > policy.quota_bytes:
            self._drop_oldest(delivery)
        return stream.last_seq

    def give_up(self, stream_id: int, delivery: str, reason: str) -> int:
        """Number a sample that cannot be kept, as a Gap."""
        stream = self._stream(stream_id, delivery)
        stream.last_seq += 1
        now_ns = self._clock.wall_ns()
        stream.unsent.append(Gap(stream.last_seq, stream.last_seq, reason, now_ns, now_ns))
        self._count_lost(stream)
        merge_last(stream.unsent)
        return stream.last_seq

    def waiting(self, delivery: str) -> Iterator[int]:
        """Streams of a class that have something to send."""
        return (s.stream_id for s in self._streams.values() if s.unsent and s.delivery == delivery)

    def take(self, stream_id: int, *, max_bytes: int, max_samples: int) -> list[Sample] | Gap | None:
        """The next run to send, now counted as sent: a Gap, or at least one sample and then what fits."""
        stream = self._streams[stream_id]
        if not stream.unsent:
            return None
        head = stream.unsent[0]
        if isinstance(head, Gap):
            stream.sent.append(stream.unsent.popleft())
            return head
        run: list[Sample] = []
        size = 0
        while stream.unsent and len(run) < max_samples:
            item = stream.unsent[0]
            if isinstance(item, Gap):
                break
            size += len(item.data) if isinstance(item.data, bytes) else 20
            if run and size > max_bytes:
                break
            run.append(item)
            stream.sent.append(stream.unsent.popleft())
        return run

    def acknowledge(self, stream_id: int, epoch: int, seq: int) -> None:
        """The gateway has everything up to `seq`.

        Raises:
            FrameError: an ack of what was never sent on this session.
        """
        stream = self._streams.get(stream_id)
        if epoch != self.epoch or stream is None:
            return
        if seq > sent_up_to(stream):
            raise FrameError(f"ack of {seq} on stream {stream_id}, sent was {sent_up_to(stream)}")
        self._forget(stream, stream.sent, seq)

    def resume(self, watermarks: Mapping[int, int]) -> None:
        """A new session: everything after the gateway's watermark (0 for a stream it does not name) is to be sent.

        Raises:
            FrameError: a watermark beyond what this epoch ever numbered.
        """
        for stream in self._streams.values():
            watermark = watermarks.get(stream.stream_id, 0)
            if watermark > stream.last_seq:
                raise FrameError(f"watermark {watermark} on stream {stream.stream_id}, accepted {stream.last_seq}")
            stream.sent.extend(stream.unsent)
            stream.sent, stream.unsent = deque(), stream.sent
            if watermark < stream.acked:
                now_ns = self._clock.wall_ns()
                lost = Gap(watermark + 1, stream.acked, "acked_and_deleted", now_ns, now_ns)
                stream.unsent.appendleft(lost)
                self.lost[stream.stream_id] = self.lost.get(stream.stream_id, 0) + stream.acked - watermark
                stream.acked = watermark
            self._forget(stream, stream.unsent, watermark)

    def _stream(self, stream_id: int, delivery: str) -> _Stream:
        stream = self._streams.get(stream_id)
        if stream is None:
            stream = self._streams[stream_id] = _Stream(stream_id, delivery)
        return stream

    def _forget(self, stream: _Stream, queue: deque[Held], seq: int) -> None:
        """Drop from the queue's head what is numbered up to `seq`."""
        while queue and first_seq(queue[0]) <= seq:
            item = queue.popleft()
            if isinstance(item, Sample):
                self._bytes[stream.delivery] -= sample_size(item.data)
                self._samples -= 1
            elif item.to_seq > seq:
                queue.appendleft(item._replace(from_seq=seq + 1))
        stream.acked = max(stream.acked, seq)
        arrivals = self._arrivals[stream.delivery]
        while arrivals and arrivals[0][1] <= arrivals[0][0].acked:
            arrivals.popleft()
        if len(arrivals) > 1000 + 2 * self._samples:
            self._arrivals[stream.delivery] = deque(entry for entry in arrivals if entry[1] > entry[0].acked)

    def _drop_oldest(self, delivery: str) -> None:
        """Turn the class's oldest held sample into a Gap, joined with its neighbours."""
        arrivals = self._arrivals[delivery]
        stream, seq = arrivals.popleft()
        while seq <= stream.acked:
            stream, seq = arrivals.popleft()
        queue = stream.sent if stream.sent and last_seq(stream.sent[-1]) >= seq else stream.unsent
        before: list[Gap] = []
        while isinstance(item := queue.popleft(), Gap):
            before.append(item)
        self._bytes[delivery] -= sample_size(item.data)
        self._samples -= 1
        now_ns = self._clock.wall_ns()
        gap = Gap(
            before[0].from_seq if before else seq, seq, "outbox_full", before[0].from_ns if before else now_ns, now_ns
        )
        if queue and isinstance(after := queue[0], Gap):
            queue.popleft()
            gap = gap._replace(to_seq=after.to_seq, to_ns=max(after.to_ns, now_ns))
        queue.appendleft(gap)
        self._count_lost(stream)

    def _count_lost(self, stream: _Stream) -> None:
        self.lost[stream.stream_id] = self.lost.get(stream.stream_id, 0) + 1


def sample_size(data: bytes | tuple[int, float]) -> int:
    """What a held sample counts against its quota."""
    return OVERHEAD_BYTES + len(data) if isinstance(data, bytes) else OVERHEAD_BYTES


def first_seq(item: Held) -> int:
    """The first number an item stands for."""
    return item.seq if isinstance(item, Sample) else item.from_seq


def last_seq(item: Held) -> int:
    """The last number an item stands for."""
    return item.seq if isinstance(item, Sample) else item.to_seq


def sent_up_to(stream: _Stream) -> int:
    """The newest number that went out on this session, or was acknowledged before."""
    return last_seq(stream.sent[-1]) if stream.sent else stream.acked


def merge_last(queue: deque[Held]) -> None:
    """Join the queue's last two items if both are gaps of one reason."""
    if len(queue) < 2:
        return
    last, before = queue[-1], queue[-2]
    if isinstance(last, Gap) and isinstance(before, Gap) and last.reason == before.reason:
        queue.pop()
        queue[-1] = before._replace(to_seq=last.to_seq, to_ns=last.to_ns)
