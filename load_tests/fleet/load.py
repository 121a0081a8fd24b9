"""What a simulated robot does: how many rows, samples and live samples it has, and what they are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from metaros._proto import link_pb2

__all__ = ["BULK", "IDLE", "LIVE", "SERIES", "Load", "announce", "metric_body", "sample_body"]

BULK: Final = 1  # numbers of the two channels
LIVE: Final = 2
SERIES: Final = 10
NOISE_BYTES: Final = 1 << 20

_RNG = np.random.default_rng(12)
_NOISE = _RNG.bytes(NOISE_BYTES)
_FRACTIONS = _RNG.random(8192)


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """Every `period_s` a robot hands over so many rows (one batch) and samples (one batch); live ones on demand."""

    name: str = "idle"
    period_s: float = 1.0
    rows: int = 0
    samples: int = 0
    sample_bytes: int = 0
    live_hz: float = 0.0
    live_bytes: int = 0

    def describe(self) -> str:
        """In words."""
        parts = []
        if self.rows:
            parts.append(f"{self.rows / self.period_s:g} rows/s")
        if self.samples:
            parts.append(f"{self.samples / self.period_s:g} samples/s of {self.sample_bytes:,} B")
        if parts:
            parts.append(f"a batch of each every {self.period_s:g} s")
        if self.live_hz:
            parts.append(f"live {self.live_hz:g}/s of {self.live_bytes:,} B while somebody watches")
        return ", ".join(parts) or "heartbeats and statistics alone"


IDLE: Final = Load()


def announce() -> link_pb2.Announce:
    """Two channels and ten series, the same for every robot."""
    channels = []
    for number, topic, kind in (
        (BULK, "/load/bulk", link_pb2.DELIVERY_CLASS_BULK),
        (LIVE, "/load/live", link_pb2.DELIVERY_CLASS_LIVE),
    ):
        channel = link_pb2.Channel(
            channel_id=number, topic=topic, encoding="cdr", schema_name="load_msgs/msg/Noise", forward=True
        )
        setattr(channel, "class", kind)
        channels.append(channel)
    series = [
        link_pb2.Series(series_id=number, name=f"load.value[{number - 1}]", topic="/load/value", field="data")
        for number in range(1, SERIES + 1)
    ]
    return link_pb2.Announce(channels=channels, series=series)


def metric_body(first_number: int, rows: int, now_ns: int, *, period_ns: int) -> bytes:
    """Columns of rows whose whole parts count up; behind the point is noise, as sensors have, so that disks feel it."""
    numbers = np.arange(first_number, first_number + rows)
    at = first_number % (len(_FRACTIONS) - rows) if rows < len(_FRACTIONS) else 0
    values = numbers + np.resize(_FRACTIONS[at:], rows)
    return link_pb2.MetricBatch(
        series_ids=(numbers % SERIES + 1).astype("<u4").tobytes(),
        stamps=(now_ns + np.arange(rows) * (period_ns // max(rows, 1))).astype("<i8").tobytes(),
        values=values.astype("<f8").tobytes(),
    ).SerializeToString()


def sample_body(first_number: int, samples: int, size_bytes: int, now_ns: int) -> bytes:
    """Columns of samples of noise, each with its number in front."""
    payloads = [noise(first_number + index, size_bytes) for index in range(samples)]
    return link_pb2.Batch(
        stamps=np.arange(now_ns, now_ns + samples, dtype="<i8").tobytes(),
        lengths=np.full(samples, size_bytes, "<u4").tobytes(),
        payload=b"".join(payloads),
    ).SerializeToString()


def noise(number: int, size_bytes: int) -> bytes:
    """A payload of that size that does not compress: its number, and bytes of a block of noise."""
    head, rest = number.to_bytes(8, "little"), max(0, size_bytes - 8)
    if rest > NOISE_BYTES:
        return (head + _NOISE * (rest // NOISE_BYTES + 1))[:size_bytes]
    at = number * 7919 % (NOISE_BYTES - rest + 1)
    return (head + _NOISE[at : at + rest])[:size_bytes]
