"""One MCAP file being written: PyPI's `mcap` for the records, our own packing of chunks for the speed.

A chunk is joined, compressed and written in one go, off the interpreter's lock, so that samples go on arriving. After
each chunk the file is readable up to there. When a chunk cannot be written (a full disk), the file is cut back to the
last whole one, and `finish` takes back as many more as the index needs.
"""

from __future__ import annotations

import struct
import zlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO, Final, Generic, TypeVar

import lz4.frame
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from metaros.errors import ConfigError

__all__ = ["COMPRESSIONS", "FAST", "SMALL", "McapFile"]

T = TypeVar("T")
COMPRESSIONS: Final = ("zstd", "lz4", "none")
_MESSAGE: Final = struct.Struct("<BQHIQQ")
_CHUNK_HEAD: Final = struct.Struct("<BQQQQII")
_FIXED: Final = _MESSAGE.size - 9  # of a message record's length: all but opcode and length
_TAKE_BACK: Final = 16  # chunks that the end of a file on a full disk may cost
FAST, SMALL = 1, 5  # zstd's levels: a recorder must keep up; what is kept for months may take twice as long
_NOISE: Final = 0.95  # what the fast level leaves so much of gains nothing by the other one


@dataclass(slots=True)
class _Chunk(Generic[T]):
    """A chunk in the making."""

    parts: list[bytes] = field(default_factory=list)
    size_bytes: int = 0
    first_ns: int = (1 << 63) - 1
    last_ns: int = 0
    index: dict[int, list[int]] = field(default_factory=dict)  # by channel: log time, offset, log time, …
    notes: list[T] = field(default_factory=list)


class McapFile(Generic[T]):
    """Writes to `output`, which must be seekable; `note` travels with each message until its chunk is safe.

    OSError of the output comes through `write`, `flush` and `finish`, after the file was cut back to whole chunks.
    """

    def __init__(
        self, output: BinaryIO, *, compression: str = "zstd", level: int = FAST, chunk_bytes: int = 1 << 20
    ) -> None:
        self._output = output
        self._compress = _compressor(compression, level)
        self._compression = "" if compression == "none" else compression
        self._chunk_bytes = chunk_bytes
        self._chunk: _Chunk[T] = _Chunk()
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._counts: dict[int, int] = {}
        self._places: list[tuple[int, Schema | Channel]] = []  # where in the file they are, ascending
        self._recent: deque[list[T]] = deque(maxlen=_TAKE_BACK)
        self._end = 0
        self.message_count = 0
        self.first_ns = (1 << 63) - 1
        self.last_ns = 0
        self.uncompressed_bytes = 0
        self._append(MCAP0_MAGIC + _packed(Header("ros2", "metaros")))

    @property
    def size_bytes(self) -> int:
        """What is on disk."""
        return self._end

    @property
    def pending_bytes(self) -> int:
        """What waits in the open chunk."""
        return self._chunk.size_bytes

    def counts(self) -> dict[int, int]:
        """Messages by channel, of the chunks on disk."""
        return dict(self._counts)

    def add_schema(self, name: str, text: bytes) -> int:
        """Write a ros2msg schema; its id. An empty text says that none is known."""
        schema = Schema(len(self._schemas) + 1, text, "ros2msg" if text else "", name)
        self._put(schema)
        self._schemas.append(schema)
        return schema.id

    def add_channel(self, topic: str, schema_id: int, metadata: Mapping[str, str], *, encoding: str = "cdr") -> int:
        """Write a channel; its id."""
        channel = Channel(len(self._channels) + 1, topic, encoding, dict(metadata), schema_id)
        if channel.id > 0xFFFF:
            raise ConfigError("an MCAP file takes at most 65,535 channels")
        self._put(channel)
        self._channels.append(channel)
        self._counts[channel.id] = 0
        return channel.id

    def write(self, channel_id: int, log_ns: int, publish_ns: int, sequence: int, payload: bytes, note: T) -> None:
        """Add one message; writes the chunk when it is full."""
        chunk = self._chunk
        size = len(payload)
        entries = chunk.index.get(channel_id)
        if entries is None:
            entries = chunk.index[channel_id] = []
        entries += (log_ns, chunk.size_bytes)
        head = _MESSAGE.pack(5, _FIXED + size, channel_id, sequence & 0xFFFFFFFF, log_ns, publish_ns)
        chunk.parts += (head, payload)
        chunk.size_bytes += _MESSAGE.size + size
        chunk.notes.append(note)
        if log_ns < chunk.first_ns:
            chunk.first_ns = log_ns
        if log_ns > chunk.last_ns:
            chunk.last_ns = log_ns
        if chunk.size_bytes >= self._chunk_bytes:
            self.flush()

    def write_records(
        self, channel_id: int, log_ns: Sequence[int], offsets: Sequence[int], records: bytes, notes: Sequence[T]
    ) -> None:
        """Add messages as records that the caller packed, each at its offset, all to the open chunk."""
        chunk = self._chunk
        start = chunk.size_bytes
        entries = chunk.index.setdefault(channel_id, [])
        for stamp_ns, offset in zip(log_ns, offsets, strict=True):
            entries += (stamp_ns, start + offset)
        chunk.parts.append(records)
        chunk.size_bytes += len(records)
        chunk.notes += notes
        chunk.first_ns, chunk.last_ns = min(chunk.first_ns, *log_ns), max(chunk.last_ns, *log_ns)

    @property
    def last_chunk(self) -> tuple[int, int]:
        """(start, bytes) of the chunk that was written last, without its message indexes."""
        index = self._chunks[-1]
        return index.chunk_start_offset, index.chunk_length

    def flush(self) -> None:
        """Write the open chunk, if it has a message; after that a `kill -9` does not lose it."""
        chunk = self._chunk
        if not chunk.notes:
            return
        raw = b"".join(chunk.parts)
        data = self._compress(raw)
        name = self._compression.encode()
        length = _CHUNK_HEAD.size - 9 + len(name) + 8 + len(data)
        head = _CHUNK_HEAD.pack(6, length, chunk.first_ns, chunk.last_ns, len(raw), zlib.crc32(raw), len(name))
        start = self._end
        index_start = start + 9 + length
        offsets, indexes = _message_indexes(chunk.index, index_start)
        self._append(head + name + struct.pack("<Q", len(data)), data, indexes)
        self._chunks.append(
            ChunkIndex(
                message_start_time=chunk.first_ns,
                message_end_time=chunk.last_ns,
                chunk_start_offset=start,
                chunk_length=9 + length,
                message_index_offsets=offsets,
                message_index_length=len(indexes),
                compression=self._compression,
                compressed_size=len(data),
                uncompressed_size=len(raw),
            )
        )
        for channel_id, entries in chunk.index.items():
            self._counts[channel_id] += len(entries) // 2
        self.message_count += len(chunk.notes)
        self.first_ns, self.last_ns = min(self.first_ns, chunk.first_ns), max(self.last_ns, chunk.last_ns)
        self.uncompressed_bytes += len(raw)
        self._recent.append(chunk.notes)
        self._chunk = _Chunk()

    def abandon_chunk(self) -> list[T]:
        """Give up the open chunk; the notes of its messages. Its schemas and channels stay."""
        notes = self._chunk.notes
        self._chunk = _Chunk()
        return notes

    def finish(
        self, metadata: Callable[[], Sequence[tuple[str, Mapping[str, str]]]], lost: Callable[[list[T]], object]
    ) -> None:
        """Write the rest, `metadata()` as records, and the index.

        Where the disk is full, chunks are taken back until the index fits, newest first; `lost` gets the notes of
        each. OSError when even that does not help: the file then ends after its last whole chunk.
        """
        try:
            self.flush()
        except OSError:
            lost(self.abandon_chunk())
        while True:
            try:
                self._append(self._closing(metadata()))
                return
            except OSError:
                if not self._recent:
                    raise
                lost(self._take_back())

    def _take_back(self) -> list[T]:
        """Drop the newest chunk from the file; the notes of its messages."""
        notes, index = self._recent.pop(), self._chunks.pop()
        offsets = sorted((offset, channel) for channel, offset in index.message_index_offsets.items())
        ends = [offset for offset, _ in offsets[1:]]
        ends.append(index.chunk_start_offset + index.chunk_length + index.message_index_length)
        for (offset, channel), end in zip(offsets, ends, strict=True):
            self._counts[channel] -= (end - offset - 15) // 16
        self.message_count -= len(notes)
        self.uncompressed_bytes -= index.uncompressed_size
        self.first_ns = min((chunk.message_start_time for chunk in self._chunks), default=(1 << 63) - 1)
        self.last_ns = max((chunk.message_end_time for chunk in self._chunks), default=0)
        self._end = index.chunk_start_offset
        self._cut()
        while self._places and self._places[-1][0] >= self._end:  # of later chunks, which went before
            record = self._places.pop()[1]
            if isinstance(record, Channel):
                self._channels.remove(record)
                del self._counts[record.id]
            else:
                self._schemas.remove(record)
        return notes

    def _closing(self, metadata: Sequence[tuple[str, Mapping[str, str]]]) -> bytes:
        """Metadata records, the summary and the footer, as they follow the last chunk."""
        data, indexes = b"", []
        for name, values in metadata:
            record = _packed(Metadata(name, dict(values)))
            indexes.append(MetadataIndex(self._end + len(data), len(record), name))
            data += record
        data += _packed(DataEnd(0))
        start = self._end + len(data)
        groups: list[tuple[Opcode, list[Any]]] = [
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics(len(indexes))]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.METADATA_INDEX, indexes),
        ]
        summary, offsets = b"", b""
        for opcode, records in groups:
            group = b"".join(map(_packed, records))
            if group:
                offsets += _packed(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        offset_start = start + len(summary)
        summary += offsets
        head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offset_start)
        crc = zlib.crc32(head, zlib.crc32(summary))
        return data + summary + _packed(Footer(start, offset_start, crc)) + MCAP0_MAGIC

    def _statistics(self, metadata_count: int) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self.message_count,
            message_end_time=self.last_ns,
            message_start_time=self.first_ns if self.message_count else 0,
            metadata_count=metadata_count,
            schema_count=len(self._schemas),
        )

    def _put(self, record: Schema | Channel) -> None:
        """A schema or channel: outside of chunks, so that it stays when its first chunk is given up."""
        place = self._end
        self._append(_packed(record))
        self._places.append((place, record))

    def _append(self, *parts: bytes) -> None:
        """Write all of it, or cut the file back to where it was and raise."""
        try:
            for part in parts:
                _write_all(self._output, part)
        except OSError:
            self._cut()
            raise
        self._end += sum(map(len, parts))

    def _cut(self) -> None:
        """Back to the last whole record."""
        self._output.seek(self._end)
        self._output.truncate(self._end)


def _write_all(output: BinaryIO, data: bytes) -> None:
    """An unbuffered file writes as much as fits."""
    view = memoryview(data)
    while view:
        written = output.write(view)
        if not written:
            raise OSError("the output takes no more bytes")
        view = view[written:]


def _packed(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _message_indexes(index: dict[int, list[int]], start: int) -> tuple[dict[int, int], bytes]:
    """The index record of each channel, and where in the file it will be."""
    offsets: dict[int, int] = {}
    records: list[bytes] = []
    for channel_id, entries in index.items():
        offsets[channel_id] = start
        size = 8 * len(entries)
        record = struct.pack(f"<BQHI{len(entries)}Q", 7, 6 + size, channel_id, size, *entries)
        records.append(record)
        start += len(record)
    return offsets, b"".join(records)


def _compressor(name: str, level: int) -> Callable[[bytes], bytes]:
    if name == "zstd":
        return _zstd(level)
    if name == "lz4":
        compress: Callable[[bytes], bytes] = lz4.frame.compress
        return compress
    if name == "none":
        return bytes
    raise ConfigError(f"{name!r} is no compression: one of {', '.join(COMPRESSIONS)}")


def _zstd(level: int) -> Callable[[bytes], bytes]:
    fast, slow = zstandard.ZstdCompressor(level=FAST), zstandard.ZstdCompressor(level=level)

    def compress(raw: bytes) -> bytes:
        """Pictures and films take the slow way ten times as long, and stay what they are."""
        quick = fast.compress(raw)
        return quick if len(quick) > _NOISE * len(raw) else slow.compress(raw)

    return fast.compress if level <= FAST else compress
