"""What an MCAP file holds, from its index, or by reading on as far as it is whole when there is none.

A recorder that was killed leaves a file without an index: everything up to its last whole chunk is there.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, Any, BinaryIO, Final, cast

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Header, Metadata, MetadataIndex, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from metaros.errors import RecordingError
from metaros.limits import LIMITS

__all__ = ["FileIndex", "read_chunk", "read_index", "records_of"]

_HEAD: Final = struct.Struct("<BQ")
_CHUNK: Final = struct.Struct("<QQQII")
_RECORD_BYTES: Final = 4 << 30
_FOOTER_BYTES: Final = _HEAD.size + 20


@dataclass(slots=True)
class FileIndex:
    """One file. `damage` says in words what is wrong with it; what is listed is readable all the same."""

    path: Path
    profile: str = ""
    library: str = ""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    size_bytes: int = 0
    damage: str = ""

    @property
    def message_count(self) -> int:
        """Over all channels."""
        return sum(self.counts.values())

    @property
    def first_ns(self) -> int:
        """Log time of the oldest message, 0 without any."""
        return min((chunk.message_start_time for chunk in self.chunks if chunk.message_end_time), default=0)

    @property
    def last_ns(self) -> int:
        """Log time of the newest message."""
        return max((chunk.message_end_time for chunk in self.chunks), default=0)


def read_index(path: Path) -> FileIndex:
    """The index of a file; RecordingError when it is no MCAP file at all."""
    try:
        with path.open("rb") as source:
            return _read(path, source)
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror or error}") from None


def _read(path: Path, source: BinaryIO) -> FileIndex:
    if source.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        raise RecordingError(f"{path} is no MCAP file")
    index = FileIndex(path, size_bytes=path.stat().st_size)
    if _from_summary(index, source):
        return index
    index = FileIndex(path, size_bytes=index.size_bytes, damage="no index: the recorder did not close the file")
    _scan(index, source)
    return index


def _from_summary(index: FileIndex, source: BinaryIO) -> bool:
    """Whether the file has a sound summary."""
    stream = _Within(source, index.size_bytes)
    found = FileIndex(index.path)
    statistics: Statistics | None = None
    try:
        header = _record(stream, len(MCAP0_MAGIC))
        footer = _record(stream, index.size_bytes - len(MCAP0_MAGIC) - _FOOTER_BYTES)
        if not isinstance(header, Header) or not isinstance(footer, Footer) or not footer.summary_start:
            return False
        for record in _records(stream, footer.summary_start):
            match record:
                case Schema():
                    found.schemas[record.id] = record
                case Channel():
                    found.channels[record.id] = record
                case ChunkIndex():
                    found.chunks.append(record)
                case Statistics():
                    statistics = record
                case MetadataIndex():
                    place = source.tell()
                    metadata = _record(stream, record.offset)
                    if not isinstance(metadata, Metadata):
                        return False
                    found.metadata.append((metadata.name, metadata.metadata))
                    source.seek(place)
                case Footer():
                    break
    except (McapError, ValueError, struct.error, EOFError, OSError, KeyError, OverflowError, StopIteration):
        return False
    if statistics is None or (statistics.message_count and not found.chunks):  # not chunked: nothing we would write
        return False
    if not all(_is_inside(chunk, index.size_bytes) for chunk in found.chunks):
        return False
    index.profile, index.library = header.profile, header.library
    index.schemas, index.channels = found.schemas, found.channels
    index.chunks, index.metadata = found.chunks, found.metadata
    index.counts = dict(statistics.channel_message_counts)
    return True


def _records(stream: _Within, place: int) -> Iterator[Any]:
    """The library's records from there on; chunks as they are, for it would unpack whatever they say."""
    stream.seek(place)
    reader = StreamReader(cast("IO[bytes]", stream), skip_magic=True, emit_chunks=True)
    return iter(reader.records)


def _record(stream: _Within, place: int) -> Any:
    """The record there."""
    return next(_records(stream, place))


class _Within:
    """A file for the library's reader: asked for more than there is, it takes no memory for it."""

    def __init__(self, source: BinaryIO, size_bytes: int) -> None:
        self._source = source
        self._size_bytes = size_bytes
        source.seek(0)

    def read(self, size_bytes: int = -1) -> bytes:
        """At most so many bytes."""
        rest = max(0, self._size_bytes - self._source.tell())
        return self._source.read(rest if size_bytes < 0 else min(size_bytes, rest))

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go elsewhere."""
        return self._source.seek(offset, whence)

    def tell(self) -> int:
        """Where it stands."""
        return self._source.tell()

    def seekable(self) -> bool:
        """It is a file."""
        return True


def _is_inside(chunk: ChunkIndex, size_bytes: int) -> bool:
    """Whether a chunk can lie where the index says."""
    end = chunk.chunk_start_offset + chunk.chunk_length
    return chunk.chunk_length >= _HEAD.size + _CHUNK.size and end <= size_bytes


def _scan(index: FileIndex, source: BinaryIO) -> None:
    """Record by record, until the file ends or breaks."""
    source.seek(place := len(MCAP0_MAGIC))
    while True:
        head = source.read(_HEAD.size)
        if len(head) < _HEAD.size:
            return
        opcode, length = _HEAD.unpack(head)
        if length > _RECORD_BYTES or place + _HEAD.size + length > index.size_bytes:
            index.damage += f"; its last {index.size_bytes - place} bytes are the beginning of a record"
            return
        if opcode in (Opcode.DATA_END, Opcode.FOOTER):
            return
        try:
            _note(index, opcode, source.read(length), place)
        except (RecordingError, McapError, ValueError, struct.error, zstandard.ZstdError, RuntimeError) as error:
            index.damage += f"; the record at byte {place} is damaged: {error}"
        place += _HEAD.size + length
        source.seek(place)


def _note(index: FileIndex, opcode: int, body: bytes, place: int) -> None:
    stream = ReadDataStream(BytesIO(body))
    if opcode == Opcode.HEADER:
        header = Header.read(stream)
        index.profile, index.library = header.profile, header.library
    elif opcode == Opcode.SCHEMA:
        schema = Schema.read(stream)
        index.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(stream)
        index.channels[channel.id] = channel
    elif opcode == Opcode.METADATA:
        metadata = Metadata.read(stream)
        index.metadata.append((metadata.name, metadata.metadata))
    elif opcode == Opcode.CHUNK:
        first_ns, last_ns, size, crc, name_length = _CHUNK.unpack_from(body)
        name = body[_CHUNK.size : _CHUNK.size + name_length].decode()
        data = body[_CHUNK.size + name_length + 8 :]
        raw = _decompressed(data, name, size, crc)
        for inner, content in records_of(raw):
            if inner == Opcode.CHUNK:
                raise RecordingError("a chunk in a chunk")
            if inner == Opcode.MESSAGE:
                channel_id = int.from_bytes(content[:2], "little")
                index.counts[channel_id] = index.counts.get(channel_id, 0) + 1
            else:
                _note(index, inner, bytes(content), 0)
        index.chunks.append(
            ChunkIndex(
                chunk_length=_HEAD.size + len(body),
                chunk_start_offset=place,
                compression=name,
                compressed_size=len(data),
                message_end_time=last_ns,
                message_index_length=0,
                message_index_offsets={},
                message_start_time=first_ns,
                uncompressed_size=size,
            )
        )


def read_chunk(source: BinaryIO, chunk: ChunkIndex) -> bytes:
    """A chunk's records; RecordingError when its checksum is wrong."""
    source.seek(chunk.chunk_start_offset + _HEAD.size)
    body = source.read(chunk.chunk_length - _HEAD.size)
    try:
        _first, _last, size, crc, name_length = _CHUNK.unpack_from(body)
        return _decompressed(body[_CHUNK.size + name_length + 8 :], chunk.compression, size, crc)
    except (struct.error, zstandard.ZstdError, RuntimeError, RecordingError) as error:
        raise RecordingError(f"the chunk at byte {chunk.chunk_start_offset} is damaged: {error}") from None


def _decompressed(data: bytes, compression: str, size: int, crc: int) -> bytes:
    raw: Any
    if size > LIMITS.recorded_chunk_bytes:
        raise RecordingError(f"it says that it holds {size} bytes: the limit is {LIMITS.recorded_chunk_bytes}")
    if compression == "zstd":
        if zstandard.frame_content_size(data) not in (-1, size):  # it would be believed, whatever the bound
            raise RecordingError("its compressed records have another size than it says")
        raw = zstandard.decompress(data, max_output_size=size)
    elif compression == "lz4":
        raw = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    elif compression == "":
        raw = data
    else:
        raise RecordingError(f"unknown compression {compression!r}")
    if len(raw) != size or (crc and zlib.crc32(raw) != crc):
        raise RecordingError("its checksum does not fit its content")
    return bytes(raw)


def records_of(raw: bytes) -> Iterator[tuple[int, memoryview]]:
    """Opcode and body of each record in a chunk."""
    view, place, end = memoryview(raw), 0, len(raw)
    while place + _HEAD.size <= end:
        opcode, length = _HEAD.unpack_from(view, place)
        place += _HEAD.size
        yield opcode, view[place : place + length]
        place += length
