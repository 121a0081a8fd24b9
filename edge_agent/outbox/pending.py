"""What was handed to the outbox and is not on disk yet: gathered by stream, packed into frames for one write."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

from edge_agent.outbox.segment import Frame, Gap, Kind
from metaros._proto import link_pb2
from metaros.limits import Limits

__all__ = ["ROW_BYTES", "Lost", "Pending", "Row", "Sample", "Seal", "pack"]

ROW_BYTES = 20
# What one frame gathers. They travel one by one, and a live sample waits for the one under way: on a slow link a
# frame of 1 MiB is a second. Smaller ones would cost more than they carry.
FRAME_BYTES = 128 * 1024
Row = tuple[int, float]  # series id, value
Sample = tuple[int, bytes | Row]  # stamp ns, CDR or a metric row
# Of stream, epoch, seq and payload: what is kept of it; None: nothing may be.
Seal = Callable[[int, int, int, bytes], bytes | None]
UNSEALED = "not_sealed"  # why there is a gap where a sample could not be sealed


@dataclass(slots=True)
class Lost:
    """Samples in a stream's order that cannot be kept: they get numbers, and a gap in their place."""

    count: int
    reason: str
    from_ns: int
    to_ns: int


class Pending:
    """One log's gathering place. The event loop owns it."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._streams: dict[int, list[Sample | Lost]] = {}
        self.size_bytes = 0
        self.count = 0
        self.since_s: float | None = None

    def __bool__(self) -> bool:
        return bool(self._streams)

    def append(self, stream_id: int, sample: Sample, now_s: float) -> None:
        """Another sample of a stream, which gathers as if it had come then."""
        self._streams.setdefault(stream_id, []).append(sample)
        self.size_bytes += size_of(sample)
        self.count += 1
        self.since_s = now_s if self.since_s is None else min(self.since_s, now_s)

    def lose(self, stream_id: int, reason: str, wall_ns: int, now_s: float) -> None:
        """A sample of a stream that cannot be kept."""
        queue = self._streams.setdefault(stream_id, [])
        add_lost(queue, Lost(1, reason, wall_ns, wall_ns))
        if self.since_s is None:
            self.since_s = now_s

    def lose_all(self, reason: str, wall_ns: int) -> int:
        """Everything gathered becomes lost; how many samples that were."""
        lost = self.count
        for stream_id, queue in self._streams.items():
            self._streams[stream_id] = as_lost(queue, reason, wall_ns)
        self.size_bytes = self.count = 0
        return lost

    def take(self) -> dict[int, list[Sample | Lost]]:
        """Hand over what was gathered, and begin again."""
        streams, self._streams = self._streams, {}
        self.size_bytes = self.count = 0
        self.since_s = None
        return streams

    def restore(self, streams: dict[int, list[Sample | Lost]], since_s: float) -> None:
        """What was taken could not be written now, and is to be tried again later, in front of what came since."""
        for stream_id, queue in streams.items():
            self._streams[stream_id] = [*queue, *self._streams.get(stream_id, ())]
            kept = [size_of(item) for item in queue if not isinstance(item, Lost)]
            self.size_bytes += sum(kept)
            self.count += len(kept)
        self.since_s = since_s

    def put_back(self, streams: dict[int, list[Sample | Lost]], reason: str, wall_ns: int, now_s: float) -> int:
        """What was taken could not be written: it is lost, in front of what came since; how many samples."""
        lost = 0
        for stream_id, queue in streams.items():
            lost += sum(not isinstance(item, Lost) for item in queue)
            front = as_lost(queue, reason, wall_ns)
            for item in self._streams.get(stream_id, ()):
                if isinstance(item, Lost):
                    add_lost(front, item)
                else:
                    front.append(item)
            self._streams[stream_id] = front
        self.since_s = now_s if self.since_s is None else self.since_s
        return lost


def pack(
    streams: dict[int, list[Sample | Lost]],
    next_seq: Callable[[int], int],
    *,
    wall_ns: int,
    mono_ns: int,
    limits: Limits,
    epoch: int = 0,
    seal: Seal | None = None,
    on_lost: Callable[[], None] = lambda: None,
) -> Iterator[Frame]:
    """The frames of what was gathered, numbered on from `next_seq(stream)`, each sample as `seal` makes it.

    A sample that `seal` keeps nothing of becomes lost, in `streams` too, and `on_lost` is called.
    """
    for stream_id, queue in streams.items():
        seq = next_seq(stream_id)
        made = sealed(queue, partial(seal, stream_id, epoch), seq, wall_ns, on_lost) if seal else queue
        for run in runs(made, limits):
            if isinstance(run, Lost):
                gap = Gap(seq, seq + run.count - 1, run.reason, run.from_ns, run.to_ns)
                yield Frame.of_gap(stream_id, gap, wall_ns=wall_ns, mono_ns=mono_ns)
                seq += run.count
                continue
            kind, body = (Kind.SAMPLES, samples_body(run)) if isinstance(run[0][1], bytes) else rows_body(run)
            yield Frame(kind, stream_id, seq, len(run), wall_ns, mono_ns, body)
            seq += len(run)


def sealed(
    queue: list[Sample | Lost],
    seal: Callable[[int, bytes], bytes | None],
    seq: int,
    wall_ns: int,
    on_lost: Callable[[], None],
) -> list[Sample | Lost]:
    """The queue with every payload as `seal` makes it under its number; what was gathered stays as it was.

    But a sample that nothing may be kept of is lost there, too: another try at writing does not count it again.
    """
    made: list[Sample | Lost] = []
    for index, item in enumerate(queue):
        if isinstance(item, Lost):
            add_lost(made, replace(item))  # its own: the next loss may be joined to it
            seq += item.count
            continue
        stamp_ns, data = item
        kept = seal(seq, data) if isinstance(data, bytes) else data
        if kept is None:
            queue[index] = lost = Lost(1, UNSEALED, wall_ns, wall_ns)
            add_lost(made, replace(lost))
            on_lost()
        else:
            made.append((stamp_ns, kept))
        seq += 1
    return made


def runs(queue: list[Sample | Lost], limits: Limits) -> Iterator[list[Sample] | Lost]:
    """Stretches of a stream that fit one frame, and what is lost between them."""
    most_bytes = min(FRAME_BYTES, limits.batch_bytes)
    run: list[Sample] = []
    size = 0
    for item in queue:
        if isinstance(item, Lost):
            if run:
                yield run
            run, size = [], 0
            yield item
            continue
        more = size_of(item)
        if run and (size + more > most_bytes or len(run) == limits.batch_samples):
            yield run
            run, size = [], 0
        run.append(item)
        size += more
    if run:
        yield run


def samples_body(run: list[Sample]) -> bytes:
    """The columns of a Batch, as protobuf fields without its numbers."""
    stamps, payloads = zip(*run, strict=True)
    return link_pb2.Batch(
        stamps=struct.pack(f"<{len(stamps)}q", *stamps),
        lengths=struct.pack(f"<{len(payloads)}I", *map(len, payloads)),
        payload=b"".join(payloads),
    ).SerializeToString()


def rows_body(run: list[Sample]) -> tuple[Kind, bytes]:
    """The columns of a MetricBatch, as protobuf fields without its numbers."""
    rows = [data for _, data in run]
    body = link_pb2.MetricBatch(
        series_ids=struct.pack(f"<{len(rows)}I", *(row[0] for row in rows)),
        stamps=struct.pack(f"<{len(run)}q", *(stamp for stamp, _ in run)),
        values=struct.pack(f"<{len(rows)}d", *(row[1] for row in rows)),
    ).SerializeToString()
    return Kind.METRICS, body


def size_of(sample: Sample) -> int:
    """What a sample counts."""
    data = sample[1]
    return len(data) + 12 if isinstance(data, bytes) else ROW_BYTES


def as_lost(queue: list[Sample | Lost], reason: str, wall_ns: int) -> list[Sample | Lost]:
    """The queue with every sample lost."""
    front: list[Sample | Lost] = []
    for item in queue:
        add_lost(front, item if isinstance(item, Lost) else Lost(1, reason, wall_ns, wall_ns))
    return front


def add_lost(queue: list[Sample | Lost], more: Lost) -> None:
    """Join losses of one reason."""
    last = queue[-1] if queue else None
    if isinstance(last, Lost) and last.reason == more.reason:
        last.count += more.count
        last.to_ns = max(last.to_ns, more.to_ns)
    else:
        queue.append(more)
