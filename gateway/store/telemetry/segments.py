"""A segment: many received batches of one robot as one MCAP file, with the place of every run in it. Pure.

Batches that follow each other in a stream become one run; a run lies in one chunk and a batch in one run, so that
whoever knew a batch finds its samples in one piece. Each chunk has the samples of one stream only: to read a topic is
to read that topic's bytes. What was packed is read back here and compared with what was to be packed.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gateway.domain.qos import offered_qos
from gateway.errors import CorruptObjectError
from gateway.store.telemetry.samples import StoredBatch
from gateway.store.telemetry.segment_records import RECORD_BYTES, holds, joined, pack_records
from metaros.mcap import SMALL, MalformedChunkError, McapFile, read_chunk, read_messages

__all__ = [
    "CHUNK_BYTES",
    "MOST_CHUNK_BYTES",
    "RUN_NS",
    "Packed",
    "PackedRun",
    "Segment",
    "open_chunk",
    "pack",
    "unpack",
]

Stamps = npt.NDArray[np.int64]
Lengths = npt.NDArray[np.uint32]
CHUNK_BYTES = 512 << 10  # uncompressed; what is read to get at one sample
RUN_NS = 600 * 10**9  # what a run of several batches lasts at most: a clock that jumps begins a new one
MOST_CHUNK_BYTES = 64 << 20  # of a chunk with a single batch: a sample has at most 16 MiB


@dataclass(frozen=True, slots=True)
class Packed:
    """A batch to be packed, with its channel's number in the database."""

    channel: int
    batch: StoredBatch


@dataclass(slots=True)
class PackedRun:
    """One run of a segment, as a row of `segment_runs` has it."""

    channel: int
    stream_id: int
    epoch: int
    first_seq: int
    count: int
    first_ns: int
    last_ns: int
    receive_ns: int
    stored_ns: int
    offset: int
    size_bytes: int
    file_channel: int  # its channel's number in the file
    chunk_start: int = 0
    chunk_bytes: int = 0

    def takes(self, item: Packed) -> bool:
        """Whether a batch goes on where this run ends, and does not make it too long."""
        batch = item.batch
        key = (item.channel, batch.stream_id, batch.epoch, batch.first_seq)
        if key != (self.channel, self.stream_id, self.epoch, self.first_seq + self.count):
            return False
        first_ns, last_ns = int(batch.stamps_ns.min()), int(batch.stamps_ns.max())
        return max(last_ns, self.last_ns) - min(first_ns, self.first_ns) <= RUN_NS

    def add(self, batch: StoredBatch) -> None:
        """Take a batch in."""
        stamps = batch.stamps_ns
        self.count += batch.count
        self.first_ns, self.last_ns = min(self.first_ns, int(stamps.min())), max(self.last_ns, int(stamps.max()))
        self.receive_ns, self.stored_ns = max(self.receive_ns, batch.receive_ns), max(self.stored_ns, batch.stored_ns)
        self.size_bytes += len(batch.payload)


@dataclass(frozen=True, slots=True)
class Segment:
    """A packed segment, ready to be put."""

    data: bytes
    sha256: str
    runs: list[PackedRun]

    @property
    def messages(self) -> int:
        """How many samples."""
        return sum(run.count for run in self.runs)

    @property
    def first_ns(self) -> int:
        """The lowest stamp."""
        return min(run.first_ns for run in self.runs)

    @property
    def last_ns(self) -> int:
        """The highest stamp."""
        return max(run.last_ns for run in self.runs)

    @property
    def stored_ns(self) -> int:
        """When the newest of its batches was stored."""
        return max(run.stored_ns for run in self.runs)


def pack(items: Sequence[Packed], *, robot_id: str) -> Segment:
    """A segment of these batches, none of which has a stamp below 0; they need no order.

    Raises:
        CorruptObjectError: what was packed reads back as something else; nothing may be deleted for it.
    """
    ordered = sorted(items, key=lambda item: (item.batch.stream_id, item.batch.epoch, item.batch.first_seq))
    packer = _Packer(robot_id)
    for item in ordered:
        packer.add(item)
    segment = packer.finish()
    _verify(segment, ordered)
    return segment


def unpack(records: bytes, *, offset: int, first_seq: int, count: int) -> tuple[Stamps, Lengths, bytes]:
    """(stamps, lengths, payloads joined) of the run that begins at `offset` of a chunk's records.

    Raises:
        CorruptObjectError: there is no such run.
    """
    stamps, payloads = [], []
    try:
        for seq, (_, sequence, stamp_ns, payload) in enumerate(read_messages(records, offset, count), first_seq):
            if sequence != seq & 0xFFFFFFFF:
                raise CorruptObjectError(f"a segment has number {sequence} where {seq} should be")
            stamps.append(stamp_ns)
            payloads.append(payload)
    except MalformedChunkError as error:
        raise CorruptObjectError(f"a segment's chunk cannot be read: {error}") from None
    lengths = np.fromiter(map(len, payloads), np.uint32, len(payloads))
    return np.array(stamps, np.int64), lengths, b"".join(payloads)


def open_chunk(data: bytes) -> bytes:
    """The records of a segment's chunk.

    Raises:
        CorruptObjectError: it is none.
    """
    try:
        return read_chunk(data, most_bytes=MOST_CHUNK_BYTES)
    except MalformedChunkError as error:
        raise CorruptObjectError(f"a segment's chunk cannot be read: {error}") from None


class _Packer:
    """Writes the file, a chunk a stream, or several of a stream that has much."""

    def __init__(self, robot_id: str) -> None:
        self._robot_id = robot_id
        self._output = io.BytesIO()
        self._file: McapFile[None] = McapFile(self._output, level=SMALL, chunk_bytes=1 << 40)
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._stream: tuple[int, int, int] | None = None
        self._channel = 0
        self._runs: list[PackedRun] = []
        self._open: list[PackedRun] = []  # of the chunk in the making
        self._batches: list[StoredBatch] = []
        self._size_bytes = 0

    def add(self, item: Packed) -> None:
        """Add a batch that comes after all others by stream, epoch and number."""
        batch = item.batch
        stream = (item.channel, batch.stream_id, batch.epoch)
        if stream != self._stream:
            self._flush()
            self._stream, self._channel = stream, self._new_channel(batch)
        elif self._size_bytes + len(batch.payload) > CHUNK_BYTES:
            self._flush()
        if not self._open or not self._open[-1].takes(item):
            self._open.append(_empty_run(item, self._size_bytes, self._channel))
        self._open[-1].add(batch)
        self._batches.append(batch)
        self._size_bytes += len(batch.payload) + RECORD_BYTES * batch.count

    def finish(self) -> Segment:
        """The whole file."""
        self._flush()
        about = {"robot": self._robot_id, "format": "1"}
        self._file.finish(lambda: [("metaros.segment", about)], _lost)
        data = self._output.getvalue()
        return Segment(data, hashlib.sha256(data).hexdigest(), self._runs)

    def _new_channel(self, batch: StoredBatch) -> int:
        channel = batch.channel
        text = channel.schema if channel.schema_encoding == "ros2msg" else b""
        key = (channel.schema_name, text)
        if key not in self._schemas:
            self._schemas[key] = self._file.add_schema(*key)
        metadata = {
            "robot": self._robot_id,
            "epoch": str(batch.epoch),
            "stream": str(batch.stream_id),
            "class": channel.delivery,
            "offered_qos_profiles": offered_qos(channel.qos),
            "topic_type_hash": channel.type_hash,
        }
        return self._file.add_channel(channel.topic, self._schemas[key], metadata, encoding=channel.encoding)

    def _flush(self) -> None:
        if not self._open:
            return
        messages = joined(self._batches)
        records, offsets = pack_records(self._channel, messages)
        notes = [None] * len(offsets)
        self._file.write_records(self._channel, messages.stamps_ns.tolist(), offsets.tolist(), records, notes)
        self._file.flush()
        for run in self._open:
            run.chunk_start, run.chunk_bytes = self._file.last_chunk
        self._runs += self._open
        self._open, self._batches, self._size_bytes = [], [], 0


def _empty_run(item: Packed, offset: int, file_channel: int) -> PackedRun:
    batch = item.batch
    lowest, highest = (1 << 63) - 1, -(1 << 63)
    key = (item.channel, batch.stream_id, batch.epoch, batch.first_seq)
    return PackedRun(*key, 0, lowest, highest, 0, 0, offset, 0, file_channel)


def _lost(_notes: object) -> None:
    raise OSError("a segment in memory lost a chunk")  # memory is never full half way: a mistake of ours


def _verify(segment: Segment, ordered: Sequence[Packed]) -> None:
    """Every batch is in the segment as it was, and nothing else is."""
    left, start, records = iter(ordered), -1, b""
    for run in segment.runs:
        if run.chunk_start != start:
            start = run.chunk_start
            records = open_chunk(segment.data[start : start + run.chunk_bytes])
        if not _same(run, records, left):
            raise CorruptObjectError("a segment was packed wrong: it reads back as something else")
    if next(left, None) is not None:
        raise CorruptObjectError("a segment was packed wrong: a batch is not in it")


def _same(run: PackedRun, records: bytes, left: Iterator[Packed]) -> bool:
    """Whether a run is the next batches, one after the other."""
    batches: list[StoredBatch] = []
    number = run.first_seq
    while number < run.first_seq + run.count:
        item = next(left, None)
        if item is None or item.batch.first_seq != number:
            return False
        batches.append(item.batch)
        number += item.batch.count
    return number == run.first_seq + run.count and holds(records, run.offset, run.file_channel, joined(batches))
