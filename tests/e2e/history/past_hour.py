"""A store in which the fake robots have an hour behind them: what history channels and series leave of it."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gateway.domain.channel import Channel, Series
from gateway.domain.robot import Robot
from gateway.domain.sample import Gap, Rows, Run
from gateway.store import RobotWrite, Store, StreamWrite, WriterWrite
from gateway.store.objects import open_objects
from gateway.store.retention import Retention
from metaros.clock import SystemClock
from metaros.idl import schema_text, type_hash
from metaros.link import SampleColumns
from tests.e2e.fake.history import KEPT_HZ
from tests.e2e.fake.robots import TOPICS, FakeRobot, FakeTopic

__all__ = ["write_past"]

EPOCH = 77
BATCH_S = 10
METRICS_HZ = 2


def write_past(
    data_dir: Path, robots: Sequence[FakeRobot], start_s: int, end_s: int, *, lost: tuple[int, int] | None = None
) -> None:
    """Write a span of robots into a data directory for a gateway; `lost` of it is declared as lost by all of them.

    Times are whole multiples of 10 s since the epoch.
    """
    asyncio.run(_write(data_dir, robots, range(start_s, end_s, BATCH_S), lost or (0, 0)))


async def _write(data_dir: Path, robots: Sequence[FakeRobot], starts: range, lost: tuple[int, int]) -> None:
    objects = open_objects("", data_dir)
    bounds = Retention(age_s=1e7, size_bytes=1 << 40)
    store = Store(data_dir, clock=SystemClock(), retention=bounds, queue_bytes=8 << 20, objects=objects)
    store.start()
    for robot in robots:
        store.submit(RobotWrite(Robot(robot.id, robot.namespace, "bench", "2.0.0"), starts[-1] * 10**9))
        store.submit(WriterWrite(robot=robot.id, epoch=EPOCH, writer="w"))
        for write in _writes(robot, starts, lost):
            await store.room(timeout_s=60)
            store.submit(write)
    await store.flush()
    await store.close()
    objects.close()


def _writes(robot: FakeRobot, starts: range, lost: tuple[int, int]) -> Iterator[StreamWrite]:
    """What a robot sent, ten seconds after ten seconds."""
    kept = [(number, topic) for number, topic in enumerate(TOPICS, 1) if topic.name in KEPT_HZ]
    for start_s in starts:
        held = not lost[0] <= start_s < lost[1]
        for number, topic in kept:
            step = 1 / KEPT_HZ[topic.name]
            count = round(BATCH_S / step)
            first = (start_s - starts[0]) // BATCH_S * count + 1
            stamps = [start_s + i * step for i in range(count)]
            run = _run(robot, number, topic, first, stamps) if held else None
            gap = None if held else _gap(first, count, start_s)
            ends = {"stream_id": number, "epoch": EPOCH, "seq": first + count - 1}
            yield StreamWrite(robot=robot.id, **ends, run=run, gap=gap)
        yield _rows(robot, start_s, starts[0], held)


def _gap(first: int, count: int, start_s: int) -> Gap:
    return Gap(first, first + count - 1, "outbox_full", start_s * 10**9, (start_s + BATCH_S) * 10**9)


def _run(robot: FakeRobot, number: int, topic: FakeTopic, first: int, stamps: Sequence[float]) -> Run:
    payloads = [robot.encode(topic, at_s) for at_s in stamps]
    columns = SampleColumns(
        stream_id=number,
        epoch=EPOCH,
        first_seq=first,
        stamps_ns=np.array([round(at_s * 1000) * 10**6 for at_s in stamps], np.int64),
        offsets=np.concatenate(([0], np.cumsum([len(item) for item in payloads]))).astype(np.int64),
        payload=b"".join(payloads),
    )
    schema = {
        "type_hash": type_hash(topic.type),
        "schema_encoding": "ros2msg",
        "schema": schema_text(topic.type).encode(),
    }
    names = {"robot": robot.id, "channel_id": number, "topic": robot.topic(topic.name), "schema_name": topic.type}
    return Run(Channel(**names, **schema, delivery="bulk", history=True), columns, columns.stamps_ns[-1].item())


def _rows(robot: FakeRobot, start_s: int, origin_s: int, held: bool) -> StreamWrite:
    """Ten seconds of every series."""
    names = tuple(robot.metrics(0.0))
    steps = BATCH_S * METRICS_HZ
    count = len(names) * steps
    first = (start_s - origin_s) // BATCH_S * count + 1
    ends = {"robot": robot.id, "stream_id": 0, "epoch": EPOCH, "seq": first + count - 1}
    if not held:
        return StreamWrite(**ends, gap=_gap(first, count, start_s))
    stamps = [start_s + i / METRICS_HZ for i in range(steps)]
    values = [list(robot.metrics(at_s).values()) for at_s in stamps]
    rows = Rows(
        tuple(Series(name, name.rsplit(".", 1)[0], name.rsplit(".", 1)[1]) for name in names),
        np.tile(np.arange(len(names), dtype=np.uint32), steps),
        np.repeat(np.array([round(at_s * 1000) * 10**6 for at_s in stamps], np.int64), len(names)),
        np.array(values, np.float64).ravel(),
    )
    return StreamWrite(**ends, rows=rows)
