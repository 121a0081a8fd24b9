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
from typing import Any, BinaryIO, Final

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, ChunkIndex, Header, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from metaros.errors import RecordingError

__all__ = ["FileIndex", "read_chunk", "read_index", "records_of"]

_HEAD: Final = struct.Struct("<BQ")
_CHUNK: Final = struct.Struct("<QQQII")
_RECORD_BYTES: Final = 4 << 30


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
    try:
        source.seek(0)
        reader = make_reader(source)
        header = reader.get_header()
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            return False
        if summary.statistics.message_count and not summary.chunk_indexes:  # not chunked: nothing we would write
            return False
        metadata = [(record.name, record.metadata) for record in reader.iter_metadata()]
    except (McapError, ValueError, struct.error, EOFError, OSError, KeyError):
        return False
    index.profile, index.library = header.profile, header.library
    index.schemas, index.channels = dict(summary.schemas), dict(summary.channels)
    index.chunks, index.metadata = list(summary.chunk_indexes), metadata
    index.counts = dict(summary.statistics.channel_message_counts)
    return True


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
    if compression == "zstd":
        raw = zstandard.decompress(data, max_output_size=size)
    elif compression == "lz4":
        raw = lz4.frame.decompress(data)
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
