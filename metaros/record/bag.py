"""Reading recordings: a file, or a folder of split files, as one stream of messages in the order of their log time."""

from __future__ import annotations

import heapq
import json
import struct
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel

from metaros.cdr import codec
from metaros.errors import MetarosError, RecordingError
from metaros.idl import Catalogue, add_schema_text, catalogue_of, default_catalogue
from metaros.idl.globs import Glob
from metaros.record.bag_index import FileIndex, read_chunk, read_index, records_of
from metaros.record.ledger import GAPS
from metaros.record.qos_yaml import read_qos
from metaros.wire import QoSProfile

__all__ = ["Bag", "BagMessage", "BagTopic", "open_bag"]

_MESSAGE: Final = struct.Struct("<HIQQ")
_END_NS: Final = 1 << 63


@dataclass(slots=True, eq=False)
class BagTopic:
    """A topic of one type in a recording."""

    name: str
    type_name: str
    type_hash: str
    schema: str
    encoding: str
    qos_text: str
    messages: int = 0
    robot: str = ""  # where a gateway or a black box wrote it: whose topic it is,
    origin: str = ""  # and its name there
    _decode: Callable[[bytes], Any] | None = field(default=None, repr=False)

    @property
    def qos(self) -> list[QoSProfile]:
        """What its publishers offered."""
        return read_qos(self.qos_text)

    def decode(self, data: bytes) -> Any:
        """A message as the recording's own schema defines it; RecordingError without a usable one."""
        if self._decode is None:
            self._decode = _decoder(self)
        return self._decode(data)


class BagMessage(NamedTuple):
    """One recorded message: `log_ns` is when it was received, `publish_ns` when it was sent."""

    topic: BagTopic
    log_ns: int
    publish_ns: int
    sequence: int
    data: bytes

    def decode(self) -> Any:
        """The message object."""
        return self.topic.decode(self.data)


class Bag:
    """A recording, opened for reading. Nothing is held open between two calls."""

    def __init__(self, path: Path, files: Sequence[FileIndex]) -> None:
        self.path = path
        self.files = sorted(files, key=lambda file: (file.first_ns, file.path.name))
        self._topics: dict[tuple[str, str, str, str], BagTopic] = {}
        self._of_channel: dict[tuple[Path, int], BagTopic] = {}
        for file in self.files:
            for channel in file.channels.values():
                topic = self._topic(file, channel)
                topic.messages += file.counts.get(channel.id, 0)
                self._of_channel[file.path, channel.id] = topic

    @property
    def topics(self) -> list[BagTopic]:
        """By name."""
        return sorted(self._topics.values(), key=lambda topic: (topic.name, topic.type_name))

    @property
    def first_ns(self) -> int:
        """Log time of the first message."""
        return min((file.first_ns for file in self.files if file.message_count), default=0)

    @property
    def last_ns(self) -> int:
        """Log time of the last message."""
        return max((file.last_ns for file in self.files), default=0)

    @property
    def message_count(self) -> int:
        """Over all topics."""
        return sum(file.message_count for file in self.files)

    def gaps(self) -> list[tuple[Path, str, str, dict[str, Any]]]:
        """The accounts in the files: path, topic, publisher's GID in hex, and what `Ledger.record` says of it."""
        found = []
        for file in self.files:
            for name, record in file.metadata:
                for key, text in record.items() if name == GAPS else ():
                    topic, _, gid = key.partition(" ")
                    if (account := _account(text)) is not None:
                        found.append((file.path, topic, gid, account))
        return found

    def chosen(self, topics: Sequence[str]) -> list[BagTopic]:
        """Those of some names or globs; without any, all."""
        globs = [Glob(name if name.startswith(("/", "**")) else f"/{name}") for name in topics]
        return [topic for topic in self.topics if not globs or any(glob.matches(topic.name) for glob in globs)]

    def messages(
        self,
        topics: Sequence[str] = (),
        *,
        start_ns: int = 0,
        end_ns: int = _END_NS,
        damaged: Callable[[str], object] | None = None,
    ) -> Iterator[BagMessage]:
        """Messages by log time, start_ns ≤ log time < end_ns, of `topics` (names or globs; none: all).

        A damaged chunk is a RecordingError, or with `damaged` skipped and told.
        """
        chosen = set(self.chosen(topics))
        wanted = {place: topic for place, topic in self._of_channel.items() if topic in chosen}
        pending = deque(self.files)  # by their first message: a file is opened when its time has come
        waiting: list[tuple[int, int, BagMessage, Iterator[BagMessage]]] = []
        while pending or waiting:
            while pending and (not waiting or pending[0].first_ns <= waiting[0][0]):
                number = len(self.files) - len(pending)
                source = self._of_file(pending.popleft(), wanted, start_ns, end_ns, damaged)
                if (message := next(source, None)) is not None:
                    heapq.heappush(waiting, (message.log_ns, number, message, source))
            if waiting:
                _log_ns, number, message, source = waiting[0]
                yield message
                if (following := next(source, None)) is None:
                    heapq.heappop(waiting)
                else:
                    heapq.heapreplace(waiting, (following.log_ns, number, following, source))

    def _of_file(
        self,
        file: FileIndex,
        wanted: dict[tuple[Path, int], BagTopic],
        start_ns: int,
        end_ns: int,
        damaged: Callable[[str], object] | None,
    ) -> Iterator[BagMessage]:
        """Chunks overlap in time: what is later than the next chunk's begin waits in a heap."""
        by_id = {channel: topic for (path, channel), topic in wanted.items() if path == file.path}
        chunks = [c for c in file.chunks if c.message_end_time >= start_ns and c.message_start_time < end_ns]
        chunks.sort(key=lambda chunk: (chunk.message_start_time, chunk.chunk_start_offset))
        waiting: list[tuple[int, int, BagMessage]] = []
        number = 0
        with file.path.open("rb") as source:
            for chunk in chunks:
                while waiting and waiting[0][0] < chunk.message_start_time:
                    yield heapq.heappop(waiting)[2]
                for message in _messages(source, chunk, by_id, damaged):
                    if start_ns <= message.log_ns < end_ns:
                        number += 1
                        heapq.heappush(waiting, (message.log_ns, number, message))
        while waiting:
            yield heapq.heappop(waiting)[2]

    def _topic(self, file: FileIndex, channel: Channel) -> BagTopic:
        schema = file.schemas.get(channel.schema_id)
        name = schema.name if schema else ""
        type_hash = channel.metadata.get("type_hash") or channel.metadata.get("topic_type_hash", "")
        key = (channel.topic, name, type_hash, channel.message_encoding)
        if key not in self._topics:
            text = schema.data.decode(errors="replace") if schema and schema.encoding == "ros2msg" else ""
            qos = channel.metadata.get("offered_qos_profiles", "")
            robot, origin = channel.metadata.get("robot", _robot_of(file)), channel.metadata.get("topic", channel.topic)
            self._topics[key] = BagTopic(
                channel.topic, name, type_hash, text, channel.message_encoding, qos, robot=robot, origin=origin
            )
        return self._topics[key]


def _account(text: str) -> dict[str, Any] | None:
    """One of them as it was written; None for what no recorder of ours wrote."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _robot_of(file: FileIndex) -> str:
    """Whose black box the file was cut from; empty where it says nothing."""
    return next((facts.get("robot", "") for name, facts in file.metadata if name == "metaros.recording"), "")


def open_bag(path: str | Path) -> Bag:
    """Open a recording: an .mcap file, or a folder of them; RecordingError when there is none."""
    path = Path(path)
    if path.is_dir():
        paths = sorted(path.glob("*.mcap"))
        if not paths:
            raise RecordingError(f"{path} holds no .mcap file")
    elif path.is_file():
        paths = [path]
    else:
        raise RecordingError(f"no such recording: {path}")
    return Bag(path, [read_index(file) for file in paths])


def _messages(
    source: BinaryIO, chunk: Any, by_id: dict[int, BagTopic], damaged: Callable[[str], object] | None
) -> Iterator[BagMessage]:
    try:
        raw = read_chunk(source, chunk)
    except RecordingError as error:
        if damaged is None:
            raise
        damaged(str(error))
        return
    for opcode, body in records_of(raw):
        if opcode == Opcode.MESSAGE and len(body) >= _MESSAGE.size:
            channel, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(body)
            topic = by_id.get(channel)
            if topic is not None:
                yield BagMessage(topic, log_ns, publish_ns, sequence, bytes(body[_MESSAGE.size :]))


def _decoder(topic: BagTopic) -> Callable[[bytes], Any]:
    """From the type of that very hash, or the schema in the file: an old recording is read as it was meant."""
    if topic.encoding != "cdr":
        raise RecordingError(f"{topic.name} is encoded as {topic.encoding!r}, which is not read here")
    known = catalogue_of(topic.type_name, topic.type_hash) if topic.type_hash else None
    catalogue = known or Catalogue(base=default_catalogue())
    try:
        if topic.schema and known is None:
            add_schema_text(topic.type_name, topic.schema, catalogue)
        return codec(topic.type_name, catalogue).decode
    except MetarosError as error:
        raise RecordingError(f"{topic.name}: no usable schema of {topic.type_name}: {error}") from None
