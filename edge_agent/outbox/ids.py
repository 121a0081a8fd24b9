"""Which number stands for which topic and series, for as long as the outbox lives: an append-only file of JSON lines.

A sample on disk names its channel and its series by number, so a number is synced before the first frame that uses
it, and never means anything else. Every line has a CRC; one that is not whole, the last after a crash, is passed over.
"""

from __future__ import annotations

import contextlib
import json
import zlib
from collections.abc import Collection, Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

from edge_agent.errors import DiskError
from edge_agent.outbox.disk import Disk

__all__ = ["ChannelId", "IdLog", "SeriesId"]

_NAME = "ids.log"
_MAX_BYTES = 64 * 1024 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelId:
    """A channel: topic, type, class, and whether sealed. `schema` is kept where the catalogue does not have it."""

    channel: int
    topic: str
    type_name: str
    type_hash: str
    delivery: str
    schema: str = ""
    sealed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesId:
    """A numeric field of a topic."""

    series: int
    name: str
    topic: str
    field: str


class IdLog:
    """The numbers given so far; new ones are written by the job that the outbox runs before its next flush."""

    def __init__(self, disk: Disk, *, held: Iterable[int] = ()) -> None:
        """Read the file; of channels only those in `held` are kept. Raises DiskError."""
        self._disk = disk
        self.channels: dict[int, ChannelId] = {}
        self.series: dict[str, SeriesId] = {}
        self._next = {"channel": 1, "series": 1}
        self._new: list[dict[str, Any]] = []
        self._damaged = 0  # lines
        self._size = 0  # up to the end of the last whole line: what a crash left behind it is written over
        for facts in self._read():
            self._learn(facts)
        known, keep = len(self.channels), set(held)
        self._next["channel"] = max(self._next["channel"], max(keep, default=0) + 1)
        self.channels = {number: channel for number, channel in self.channels.items() if number in keep}
        for number in keep - self.channels.keys():  # the file was damaged: the samples are still worth having
            self.describe(nameless(number))
        if self._damaged:
            self._name_lost_series()
        if known > 2 * len(self.channels) + 256:
            with contextlib.suppress(DiskError):  # a full disk: the file stays long for now
                self._rewrite()

    def channel(
        self, *, topic: str, type_name: str, type_hash: str, delivery: str, schema: str = "", sealed: bool = False
    ) -> int:
        """A new channel's number."""
        number = self._take("channel")
        facts = ChannelId(
            channel=number,
            topic=topic,
            type_name=type_name,
            type_hash=type_hash,
            delivery=delivery,
            schema=schema,
            sealed=sealed,
        )
        self.describe(facts)
        return number

    def describe(self, channel: ChannelId) -> None:
        """A channel is new, or more is known of it."""
        self.channels[channel.channel] = channel
        self._new.append(asdict(channel))

    def series_number(self, *, name: str, topic: str, field: str) -> int:
        """The number of a series, a new one where it has none."""
        known = self.series.get(name)
        if known is not None:
            return known.series
        series = SeriesId(series=self._take("series"), name=name, topic=topic, field=field)
        self.series[name] = series
        self._new.append(asdict(series))
        return series.series

    def keep_series(self, held: Collection[int]) -> None:
        """Forget all other series; their numbers are not given again."""
        self.series = {name: series for name, series in self.series.items() if series.series in held}
        with contextlib.suppress(DiskError):  # the file stays long for now
            self._rewrite()

    def job(self) -> IdJob | None:
        """The job that writes what is new; None when nothing is."""
        if not self._new:
            return None
        return IdJob(self._disk, self._size, b"".join(map(line, self._new)), len(self._new))

    def written(self, job: IdJob) -> None:
        """It was run."""
        self._size = job.offset + len(job.data)
        del self._new[: job.count]

    def _take(self, kind: str) -> int:
        number = self._next[kind]
        self._next[kind] += 1
        return number

    def _read(self) -> Iterator[dict[str, Any]]:
        size = min(self._disk.size(_NAME), _MAX_BYTES)
        data = self._disk.read(_NAME, 0, size) if size else b""
        self._size = data.rfind(b"\n") + 1
        for text in data[: self._size].split(b"\n"):
            crc, _, body = text.partition(b" ")
            try:
                if body and int(crc, 16) == zlib.crc32(body):
                    yield json.loads(body)
                    continue
            except ValueError:
                pass
            self._damaged += bool(text)

    def _name_lost_series(self) -> None:
        """Rows on disk may name the series of damaged lines: their numbers must be announced, and not given again."""
        self._next["series"] += self._damaged
        for number in set(range(1, self._next["series"])) - {series.series for series in self.series.values()}:
            lost = SeriesId(series=number, name=f"metaros.nameless.{number}", topic="/metaros/nameless", field="value")
            self.series[lost.name] = lost
            self._new.append(asdict(lost))

    def _learn(self, facts: dict[str, Any]) -> None:
        if "next_channel" in facts:
            self._next = {"channel": facts["next_channel"], "series": facts["next_series"]}
        elif "channel" in facts:
            self.channels[facts["channel"]] = ChannelId(**facts)
            self._next["channel"] = max(self._next["channel"], facts["channel"] + 1)
        elif "series" in facts:
            self.series[facts["name"]] = SeriesId(**facts)
            self._next["series"] = max(self._next["series"], facts["series"] + 1)

    def _rewrite(self) -> None:
        """Without what nobody holds, so that the file does not grow for ever."""
        counter = {"next_channel": self._next["channel"], "next_series": self._next["series"]}
        entries = [*map(asdict, self.channels.values()), *map(asdict, self.series.values())]
        data = b"".join(map(line, [counter, *entries]))
        self._disk.replace(_NAME, data)
        self._size = len(data)


@dataclass(frozen=True, slots=True)
class IdJob:
    """New lines on their way to the disk."""

    disk: Disk
    offset: int
    data: bytes
    count: int

    def run(self) -> None:
        """Raises DiskError and leaves nothing behind."""
        self.disk.append(_NAME, self.offset, self.data)


def nameless(number: int) -> ChannelId:
    """A channel of which only the number is known."""
    topic = f"/metaros/nameless/stream_{number}"
    return ChannelId(channel=number, topic=topic, type_name="metaros_msgs/msg/Bytes", type_hash="", delivery="bulk")


def line(facts: dict[str, Any]) -> bytes:
    """One line: the CRC of the rest, and the rest."""
    body = json.dumps(facts, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(body), body)
