"""Copies a time span of the ring into one MCAP file, a bag that any reader of ROS 2 recordings opens. Blocks.

Messages keep the robot's stamps: `log_time` is when the agent had them, `publish_time` when they were sent. Of latched
topics the samples come first that a late joiner would have got at the begin of the span. Every sequence number of the
span that is not in the file is in its metadata `metaros.gaps`, with the reason.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mcap.records import Channel

from edge_agent.blackbox.box import RingSnapshot
from edge_agent.blackbox.latched import last_of_each
from edge_agent.blackbox.mcap_reader import DEPTH_KEY, GID_KEY, Record, records
from edge_agent.blackbox.ring import RingFile
from edge_agent.errors import DiskError, DiskFullError, NothingRecordedError
from metaros.idl.globs import Glob
from metaros.mcap import McapFile
from metaros.record.bag_index import FileIndex, read_index
from metaros.record.ledger import GAPS, Ledger, Publisher

__all__ = ["Clip", "Span", "write_clip"]

CHUNK_BYTES: Final = 1 << 20
_CHECK_BYTES: Final = 8 << 20  # how much is written between two looks at the disk
_ROSBAG2: Final = {"serialized_metadata": "storage_identifier: mcap\nversion: 9\n"}
_FULL: Final = (errno.ENOSPC, errno.EDQUOT)
Note = tuple[Publisher, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """What is wanted: log times with both ends included; `topics` are patterns, none for all."""

    recording_id: str
    from_ns: int
    to_ns: int
    topics: tuple[str, ...] = ()

    def of(self, files: Iterable[RingFile]) -> list[RingFile]:
        """Those that may hold something of it."""
        return [piece for piece in files if piece.first_ns <= self.to_ns and piece.last_ns >= self.from_ns]


@dataclass(frozen=True, slots=True, kw_only=True)
class Clip:
    """A finished file; `from_ns` to `to_ns` is what the ring really had of the span."""

    size_bytes: int
    sha256: bytes
    from_ns: int
    to_ns: int
    messages: int


def write_clip(
    held: RingSnapshot, span: Span, output: Path, *, robot_id: str, check: Callable[[], object] = lambda: None
) -> Clip:
    """Write the clip to `output`, synced; `check` is called now and then, and what it raises ends the cut.

    Raises:
        NothingRecordedError: the ring has no message of the span.
        DiskFullError: the clip does not fit on the disk.
        DiskError: the disk failed.
        RecordingError: a file of the ring cannot be read.
    """
    had = [(piece.first_ns, piece.last_ns) for piece in held.files]
    found = span.of(held.files)
    if not found:
        raise NothingRecordedError("the black box holds nothing of this time")
    earlier = [piece.path for piece in held.files if piece.latched and piece.first_ns < span.from_ns]
    try:
        with output.open("wb", buffering=0) as stream:
            writer = _Writer(McapFile(stream, chunk_bytes=CHUNK_BYTES), span, held.publishers, check)
            writer.learn(indexes := {path: read_index(path) for path in _existing(held.latched, earlier, found)})
            before = (index for path, index in indexes.items() if path == held.latched or path in earlier)
            writer.put_latched(last_of_each(before, before_ns=span.from_ns))
            for piece in found:
                writer.put(records(indexes[piece.path], first_ns=span.from_ns, last_ns=span.to_ns))
            first_ns = max(span.from_ns, min(first for first, _ in had))
            last_ns = min(span.to_ns, max(last for _, last in had))
            messages = writer.finish(robot_id, first_ns, last_ns)
            os.fsync(stream.fileno())
        with output.open("rb") as source:
            digest = hashlib.file_digest(source, "sha256").digest()
    except OSError as error:
        output.unlink(missing_ok=True)
        kind = DiskFullError if error.errno in _FULL else DiskError
        raise kind(f"cannot write the recording: {error.strerror or error}") from error
    except BaseException:
        output.unlink(missing_ok=True)
        raise
    return Clip(size_bytes=output.stat().st_size, sha256=digest, from_ns=first_ns, to_ns=last_ns, messages=messages)


class _Writer:
    """The clip's file: a channel a topic, the account of what is missing."""

    def __init__(
        self,
        file: McapFile[Note],
        span: Span,
        publishers: dict[tuple[str, bytes], Publisher],
        check: Callable[[], object],
    ) -> None:
        self._file, self._span, self._check = file, span, check
        self._publishers = dict(publishers)
        self._globs = [Glob(topic) for topic in span.topics]
        self._ledger = Ledger(continues=False)
        self._schemas: dict[tuple[str, str], tuple[str, bytes]] = {}  # by the channel's identity: name, text
        self._names: dict[int, str] = {}
        self._places: dict[int, tuple[int, Publisher] | None] = {}  # by a source channel's identity
        self._channels: dict[tuple[str, str, str, str], int] = {}
        self._schema_ids: dict[tuple[str, str], int] = {}
        self._checked = self._in_span = 0

    def learn(self, indexes: dict[Path, FileIndex]) -> None:
        """The types of all files: a schema that became known later holds for earlier samples, too."""
        for index in indexes.values():
            for channel in index.channels.values():
                schema = index.schemas.get(channel.schema_id)
                name = schema.name if schema is not None else ""
                self._names[id(channel)] = name
                key = (name, channel.metadata.get("type_hash", ""))
                if schema is not None and (schema.data or key not in self._schemas):
                    self._schemas[key] = (name, schema.data)

    def put_latched(self, found: Iterable[Record]) -> None:
        """What was sent before the span and still holds; it is no part of the account."""
        for record in found:
            if (place := self._place(record.channel)) is not None:
                self._write(place[0], record, place[1])

    def put(self, found: Iterable[Record]) -> None:
        """Messages of the span."""
        note = self._ledger.note
        for record in found:
            place = self._places.get(id(record.channel), _NEW)
            if place is _NEW:
                place = self._place(record.channel)
            if place is not None:
                note(place[1], record.sequence)
                self._in_span += 1
                self._write(place[0], record, place[1])

    def finish(self, robot_id: str, first_ns: int, last_ns: int) -> int:
        """Write account and index; how many messages the file holds. NothingRecordedError where none is of the span."""
        if not self._in_span:
            raise NothingRecordedError("the black box holds nothing of these topics and this time")
        span = self._span
        about = {
            "id": span.recording_id,
            "robot": robot_id,
            "asked_from_ns": str(span.from_ns),
            "asked_to_ns": str(span.to_ns),
            "from_ns": str(first_ns),
            "to_ns": str(last_ns),
            "topics": json.dumps(span.topics),
        }
        self._file.finish(
            lambda: [(GAPS, self._ledger.record()), ("metaros.recording", about), ("rosbag2", _ROSBAG2)], _no_space
        )
        return self._file.message_count

    def _write(self, channel: int, record: Record, publisher: Publisher) -> None:
        file = self._file
        file.write(
            channel, record.log_ns, record.publish_ns, record.sequence, record.payload, (publisher, record.sequence)
        )
        if file.size_bytes >= self._checked:
            self._check()
            self._checked = file.size_bytes + _CHECK_BYTES

    def _place(self, channel: Channel) -> tuple[int, Publisher] | None:
        """Where a publisher's messages go; None where its topic is not wanted."""
        topic, type_hash = channel.topic, channel.metadata.get("type_hash", "")
        place: tuple[int, Publisher] | None = None
        if not self._globs or any(glob.matches(topic) for glob in self._globs):
            name = self._names[id(channel)]
            key = (topic, name, type_hash, channel.message_encoding)
            number = self._channels.get(key)
            if number is None:
                number = self._channels[key] = self._add(channel, name, type_hash)
            gid = bytes.fromhex(channel.metadata.get(GID_KEY, ""))
            place = number, self._publishers.setdefault((topic, gid), Publisher(topic, name, gid))
        self._places[id(channel)] = place
        return place

    def _add(self, channel: Channel, name: str, type_hash: str) -> int:
        schema = self._schema_ids.get((name, type_hash))
        if schema is None:
            text = self._schemas.get((name, type_hash), (name, b""))[1]
            schema = self._schema_ids[name, type_hash] = self._file.add_schema(name, text)
        own = (GID_KEY, DEPTH_KEY)
        return self._file.add_channel(
            channel.topic,
            schema,
            {key: text for key, text in channel.metadata.items() if key not in own},
            encoding=channel.message_encoding,
        )


_NEW: Final = (-1, Publisher("", "", b""))


def _existing(latched: Path, earlier: Sequence[Path], found: Iterable[RingFile]) -> list[Path]:
    """The files to read, each once, oldest first."""
    paths = [latched] if latched.exists() else []
    rest = {*earlier, *(piece.path for piece in found)}
    return [*paths, *sorted(rest)]


def _no_space(_notes: list[Note]) -> None:
    raise OSError(errno.ENOSPC, "no space left for the whole of it")
