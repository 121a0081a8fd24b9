"""Stored messages as an MCAP file, in pieces: nothing is kept of it but the piece in the making and the index.

The file is written by one thread, piece by piece as its reader takes them. Memory: the merge's bound
(`LIMITS.export_hold_bytes` for up to 16 robots together, 4 MiB for each beyond), one chunk, and of every chunk written
about 1 KiB of index.
"""

from __future__ import annotations

import heapq
import io
import threading
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import orjson

from gateway.domain.channel import Channel
from gateway.domain.qos import offered_qos
from gateway.history.losses import Loss, loss_view, merged_losses
from gateway.history.scan import Scan
from gateway.history.source import Source
from metaros.limits import LIMITS
from metaros.mcap import McapFile

__all__ = ["GAPS", "Export", "ExportRequest"]

GAPS: Final = "metaros.gaps"
CHUNK_BYTES: Final = 2 << 20
LEAST_HOLD_BYTES: Final = 4 << 20  # of one robot: some chunks of its segments, or they would be read again and again
WINDOW_RUNS: Final = 2048
_NO_TOPIC: Final = "-"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportRequest:
    """Which topics of which robots, and the range of stamps, both ends included."""

    topics: Mapping[str, tuple[str, ...]]  # by robot
    start_ns: int
    end_ns: int


class Export:
    """One file. `pieces` runs on a thread; `stop` may be called from any."""

    def __init__(self, source: Source, request: ExportRequest) -> None:
        self._source = source
        self._request = request
        self._stopped = threading.Event()
        self._output = _Pieces()
        self._shared = _shared_names(request.topics)
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[tuple[Any, ...], int] = {}
        self._scans = [self._scan(robot_id) for robot_id in request.topics]

    @property
    def stopped(self) -> bool:
        """Whether it was given up."""
        return self._stopped.is_set()

    def stop(self) -> None:
        """Give it up: the piece in the making is the last one, and the file is not whole."""
        self._stopped.set()

    def pieces(self) -> Iterator[bytes]:
        """The file, from its first byte to its last; StoreError when the store fails, and the file then has no end."""
        file: McapFile[None] = McapFile(self._output, chunk_bytes=CHUNK_BYTES)
        streams = [scan.messages() for scan in self._scans]
        for message in heapq.merge(*streams, key=lambda item: item.stamp_ns):
            if self._stopped.is_set():
                return
            stamp_ns = max(0, message.stamp_ns)
            file.write(self._channel(file, message.channel), stamp_ns, stamp_ns, message.seq, message.payload, None)
            if self._output.size_bytes:
                yield self._output.take()
        if self._stopped.is_set():
            return
        file.finish(lambda: [(GAPS, self._accounts(file.counts()))], lambda notes: None)
        yield self._output.take()

    def _scan(self, robot_id: str) -> Scan:
        return Scan(
            source=self._source,
            robot_id=robot_id,
            topics=self._request.topics[robot_id],
            start_ns=self._request.start_ns,
            end_ns=self._request.end_ns,
            window_runs=WINDOW_RUNS,
            hold_bytes=max(LEAST_HOLD_BYTES, LIMITS.export_hold_bytes // len(self._request.topics)),
            stopped=self._stopped.is_set,
        )

    def _channel(self, file: McapFile[None], channel: Channel) -> int:
        """A channel's number in the file, where it is written at its first message."""
        key = (*channel.identity, channel.qos)
        number = self._channels.get(key)
        if number is None:
            number = self._channels[key] = file.add_channel(
                self._name(channel.robot, channel.topic),
                self._schema(file, channel),
                _metadata(channel),
                encoding=channel.encoding,
            )
        return number

    def _schema(self, file: McapFile[None], channel: Channel) -> int:
        text = channel.schema if channel.schema_encoding == "ros2msg" else b""
        key = (channel.schema_name, text)
        if key not in self._schemas:
            self._schemas[key] = file.add_schema(channel.schema_name, text)
        return self._schemas[key]

    def _name(self, robot_id: str, topic: str) -> str:
        """A topic's name in the file: no two robots share one."""
        return f"/{robot_id}{topic}" if topic in self._shared else topic

    def _accounts(self, counts: Mapping[int, int]) -> dict[str, str]:
        """What the file has and lacks, by topic and robot; those without a loss are in it, too: that is the proof."""
        request = self._request
        found: dict[tuple[str, str], list[Loss]] = {}
        for scan in self._scans:
            robot_id = scan.robot_id
            found.update(((self._name(robot_id, topic), robot_id), []) for topic in scan.topics)
            declared = self._source.losses(robot_id, start_ns=request.start_ns, end_ns=request.end_ns)
            for loss in [*declared, *scan.losses]:
                if loss.topic is None or loss.topic in scan.topics:
                    name = self._name(robot_id, loss.topic) if loss.topic else _NO_TOPIC
                    found.setdefault((name, robot_id), []).append(loss)
        received: Counter[tuple[str, str]] = Counter()
        for identity, number in self._channels.items():
            received[self._name(identity[0], identity[1]), identity[0]] += counts[number]
        return {" ".join(key): _account(received[key], losses) for key, losses in sorted(found.items())}


class _Pieces(io.BytesIO):
    """What was written since the last `take`; it only ever grows at its end."""

    size_bytes = 0

    def write(self, data: Any) -> int:
        """All of it."""
        written = super().write(data)
        self.size_bytes += written
        return written

    def take(self) -> bytes:
        """And forget it."""
        data = self.getvalue()
        self.seek(0)
        self.truncate()
        self.size_bytes = 0
        return data


def _account(received: int, losses: Sequence[Loss]) -> str:
    """In the words of a recorder's account of a publisher; messages are counted, as numbers start anew now and then."""
    lost = sum(loss.count for loss in losses)
    facts = {"first": 1, "last": received + lost, "received": received}
    return orjson.dumps({**facts, "losses": [loss_view(loss) for loss in merged_losses(losses)]}).decode()


def _metadata(channel: Channel) -> dict[str, str]:
    """As rosbag2 and our own recorder write it, and whose it is."""
    return {
        "robot": channel.robot,
        "topic": channel.topic,
        "class": channel.delivery,
        "offered_qos_profiles": offered_qos(channel.qos),
        "topic_type_hash": channel.type_hash,
        "type_hash": channel.type_hash,
    }


def _shared_names(topics: Mapping[str, Sequence[str]]) -> set[str]:
    """Names that more than one of the robots has."""
    counts = Counter(name for names in topics.values() for name in set(names))
    return {name for name, count in counts.items() if count > 1}
