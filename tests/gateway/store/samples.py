"""What tests write to a store, and what they read from it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gateway.domain.channel import Channel, Series
from gateway.domain.sample import Gap, Rows, Run
from gateway.store import StreamWrite
from gateway.store.engine import StoreEngine
from gateway.store.telemetry.history import find_runs
from gateway.store.telemetry.load import RunLoader
from gateway.store.telemetry.query import read_gaps
from gateway.store.telemetry.samples import SampleFilter, StoredBatch
from gateway.store.telemetry.series import read_range
from metaros.link import SampleColumns

__all__ = [
    "BATTERY",
    "CPU",
    "EPOCH",
    "channel",
    "content",
    "everything",
    "gap_write",
    "read_samples",
    "rows",
    "run_write",
    "write",
]

CPU, BATTERY = Series("host.cpu", "/host/cpu", "percent"), Series("battery", "/battery", "percentage")
EPOCH = 2**64 - 3


def rows(*items: tuple[Series, int, float]) -> Rows:
    """Metric rows (series, stamp, value)."""
    series = tuple(dict.fromkeys(item[0] for item in items))
    return Rows(
        series,
        np.array([series.index(item[0]) for item in items], np.uint32),
        np.array([item[1] for item in items], np.int64),
        np.array([item[2] for item in items], np.float64),
    )


def write(seq: int, *items: tuple[Series, int, float], robot: str = "r1", **more: Any) -> StreamWrite:
    """A commit's write of the metric stream up to `seq`."""
    values = {"stream_id": 0, "epoch": EPOCH, "rows": rows(*items) if items else None, **more}
    return StreamWrite(robot=robot, seq=seq, **values)


def channel(robot: str = "r1", topic: str = "/events", delivery: str = "event") -> Channel:
    """An announced channel."""
    return Channel(
        robot=robot,
        channel_id=7,
        topic=topic,
        schema_name="std_msgs/msg/String",
        type_hash="RIHS01_1",
        schema_encoding="ros2msg",
        schema=b"string data",
        delivery=delivery,
    )


def run_write(
    first_seq: int,
    payloads: Sequence[bytes],
    *,
    robot: str = "r1",
    stream_id: int = 7,
    epoch: int = EPOCH,
    base: int = 0,
    stamp_ns: int = 1000,
    topic: str = "/events",
    delivery: str = "event",
) -> StreamWrite:
    """Messages from `first_seq` on; each is stamped `stamp_ns` + its number."""
    columns = SampleColumns(
        stream_id=stream_id,
        epoch=epoch,
        first_seq=first_seq,
        stamps_ns=np.arange(first_seq, first_seq + len(payloads), dtype=np.int64) + stamp_ns,
        offsets=np.concatenate(([0], np.cumsum([len(item) for item in payloads]))).astype(np.int64),
        payload=b"".join(payloads),
    )
    run = Run(channel(robot, topic, delivery), columns, 5)
    return StreamWrite(robot=robot, stream_id=stream_id, epoch=epoch, seq=columns.last_seq, run=run, base=base)


def gap_write(from_seq: int, to_seq: int, *, robot: str = "r1", stream_id: int = 7, base: int = 0) -> StreamWrite:
    """A declared loss."""
    gap = Gap(from_seq, to_seq, "outbox_full", 1, 2)
    return StreamWrite(robot=robot, stream_id=stream_id, epoch=EPOCH, seq=to_seq, gap=gap, base=base)


def everything(engine: StoreEngine, name: str, points: int = 10_000) -> list[tuple[float, float]]:
    """All rows of a series of r1."""
    (piece,) = read_range(engine, "r1", [name], start_ns=-(2**60), end_ns=2**60, points=points)
    return list(zip(np.rint(piece.stamp_ms * 1e6).tolist(), piece.mean.tolist(), strict=True))


def read_samples(
    engine: StoreEngine, robot: str, wanted: SampleFilter, *, limit: int, loader: RunLoader | None = None
) -> list[StoredBatch]:
    """What is wanted of a robot's messages, by stream, epoch and number."""
    batches = [(loader or RunLoader()).load(engine, run) for run in find_runs(engine, robot, wanted, limit=limit)]
    return sorted(batches, key=lambda batch: (batch.stream_id, batch.epoch, batch.first_seq))


def content(
    engine: StoreEngine, *, robot: str = "r1", stream_id: int = 7, loader: RunLoader | None = None
) -> tuple[dict[int, bytes], set[int]]:
    """A stream's messages by number, and the numbers that were declared lost; a number stored twice is an error."""
    found: dict[int, bytes] = {}
    for batch in read_samples(engine, robot, SampleFilter(stream_id=stream_id), limit=100_000, loader=loader):
        for seq, _, payload in batch.samples():
            assert seq not in found, f"{seq} is stored twice"
            found[seq] = payload
    lost: set[int] = set()
    for stored in read_gaps(engine, robot, limit=100_000):
        if stored.stream_id == stream_id:
            numbers = set(range(stored.gap.from_seq, stored.gap.to_seq + 1))
            assert not numbers & lost, "a loss is declared twice"
            lost |= numbers
    assert not lost & found.keys(), "both stored and lost"
    return found, lost
