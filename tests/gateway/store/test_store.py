"""The facade: queue, refusals, restarts, the reading API; on both databases."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.robot import Robot
from gateway.errors import StoreError
from gateway.store import Committed, Mark, RobotWrite, SampleFilter, Store, StreamWrite, WriterWrite
from gateway.store.retention import Retention
from gateway.store.sqlite import SqliteEngine
from gateway.store.writer import Pace
from metaros.clock import ManualClock, SystemClock
from metaros.errors import ConfigError
from tests.gateway.store.samples import CPU, EPOCH, gap_write, run_write, write
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until_async

RETENTION = Retention(age_s=100.0, size_bytes=1 << 30)


def open_store(folder: Path, url: str = "", **options: Any) -> Store:
    chosen = {"clock": SystemClock(), "retention": RETENTION, "queue_bytes": 1 << 20, "url": url, **options}
    return Store(folder, **chosen)


async def test_store_commits_and_remembers(tmp_path: Path, store_url: str) -> None:
    store = open_store(tmp_path, store_url)
    received: list[Committed] = []
    store.start(received.append)
    robot = Robot("r1", "/r1", "host", "1", {"site": "a\0b"})
    store.submit(RobotWrite(robot, 7))
    store.submit(WriterWrite(robot="r1", epoch=EPOCH, writer="w"))
    store.submit(write(1, (CPU, 1, 1.0)))
    await store.flush()
    await wait_until_async(lambda: received)
    assert [type(item) for done in received for item in done.writes] == [RobotWrite, WriterWrite, StreamWrite]
    assert [mark for done in received for mark in done.marks] == [Mark("r1", 0, EPOCH, 1)]
    ids = (store.store_id, store.gateway_id)
    await store.close()
    again = open_store(tmp_path, store_url)
    again.start()
    assert (again.store_id, again.gateway_id) == ids
    assert [item.robot for item in await again.robots()] == [robot]
    assert await again.streams("r1") == {(0, EPOCH): 1}
    assert await again.writers("r1") == {EPOCH: "w"}
    assert (await again.range("r1", ["host.cpu"], start_ns=0, end_ns=10, points=5))[0].mean.tolist() == [1.0]
    await again.close()


async def test_messages_are_read_back_by_topic_number_and_time(tmp_path: Path, store_url: str) -> None:
    store = open_store(tmp_path, store_url)
    store.start()
    for write_ in (
        run_write(1, [b"a", b"", b"ccc"]),
        run_write(4, [b"d" * 100_000]),
        gap_write(5, 6),
        run_write(1, [b"z"], stream_id=8, topic="/scan", delivery="bulk", stamp_ns=5000),
        run_write(1, [b"other"], robot="r2"),
    ):
        store.submit(write_)
    await store.flush()
    first, second, scan = await store.samples("r1")
    assert list(first.samples()) == [(1, 1001, b"a"), (2, 1002, b""), (3, 1003, b"ccc")]
    assert (second.first_seq, second.last_seq, second.count, second.payload) == (4, 4, 1, b"d" * 100_000)
    assert (first.epoch, first.receive_ns, first.channel.topic, first.channel.schema) == (
        EPOCH,
        5,
        "/events",
        b"string data",
    )
    assert (scan.channel.topic, scan.channel.delivery) == ("/scan", "bulk")
    wanted: list[tuple[dict[str, Any], list[int]]] = [
        ({"topic": "/events"}, [1, 4]),
        ({"stream_id": 7, "epoch": EPOCH, "first_seq": 3}, [1, 4]),
        ({"stream_id": 7, "first_seq": 4}, [4]),
        ({"topic": "/events", "start_ns": 1004}, [4]),
        ({"topic": "/events", "end_ns": 1003}, [1]),
        ({"epoch": 1}, []),
        ({"topic": "/nothing"}, []),
    ]
    for options, numbers in wanted:
        assert [batch.first_seq for batch in await store.samples("r1", SampleFilter(**options))] == numbers, options
    assert len(await store.samples("r1", limit=1)) == 1
    (gap,) = await store.gaps("r1", limit=10)
    assert (gap.stream_id, gap.epoch, gap.gap.from_seq, gap.gap.to_seq) == (7, EPOCH, 5, 6)
    await store.close()


async def test_a_full_disk_refuses_and_then_all_is_stored(tmp_path: Path) -> None:
    store = open_store(tmp_path, queue_bytes=4000, pace=Pace(retry_every_s=0.01))
    blocker = SqliteEngine(tmp_path)
    refused: list[set[str]] = []
    received: list[Committed] = []
    with blocker.transaction(write=True):  # nobody else can commit: the writer's own timeout makes it fail
        store.start(received.append, lambda robots: refused.append(set(robots)))
        assert isinstance(store._engine, SqliteEngine)
        store._engine.connection.execute("PRAGMA busy_timeout = 1")
        store.submit(WriterWrite(robot="r1", epoch=EPOCH, writer="w"))
        for seq in range(1, 30):
            store.submit(write(seq, (CPU, seq, 1.0)))
        assert not await store.room(timeout_s=0) or refused
        await wait_until_async(lambda: refused)
        assert store.error is not None
    blocker.close()
    assert set.union(*refused) == {"r1"}
    assert await store.room(timeout_s=60)
    for seq in range(1, 30):  # the robot sends it again
        store.submit(write(seq, (CPU, seq, 1.0)))
    await wait_until_async(lambda: received and received[-1].marks[-1:] == [Mark("r1", 0, EPOCH, 29)])
    assert store.error is None
    assert (await store.series("r1"))[0].samples == 29
    assert await store.writers("r1") == {EPOCH: "w"}  # what only the gateway knows is kept
    await store.close()


async def test_one_robots_impossible_values_do_not_stop_the_others(tmp_path: Path, store_url: str) -> None:
    store = open_store(tmp_path, store_url)
    refused: list[set[str]] = []
    for robot, stamp_ns in (("good", 1), ("bad", 2**63), ("fine", 1)):
        store.submit(StreamWrite(robot=robot, stream_id=7, epoch=1, seq=1, gap=gap_write(1, 1).gap, base=0))
        if robot == "bad":
            store.submit(RobotWrite(Robot("bad"), stamp_ns))
    store.start(None, lambda robots: refused.append(set(robots)))
    await store.flush()
    await wait_until_async(lambda: refused)
    assert refused == [{"bad"}]
    assert store.error is None
    assert [await store.streams(robot) for robot in ("good", "bad", "fine")] == [{(7, 1): 1}, {}, {(7, 1): 1}]
    await store.close()


def test_one_gateway_a_directory(tmp_path: Path) -> None:
    clock = ManualClock()
    first = open_store(tmp_path, clock=clock)
    with pytest.raises(ConfigError, match="another gateway"):
        open_store(tmp_path, clock=clock)
    asyncio.run(first.close())
    asyncio.run(open_store(tmp_path, clock=clock).close())


async def test_two_gateways_share_a_postgresql_store(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    one, two = open_store(tmp_path / "1", url), open_store(tmp_path / "2", url)
    assert one.store_id == two.store_id
    assert one.gateway_id != two.gateway_id
    one.start()
    two.start()
    for first in range(1, 400, 4):  # both have every sample, cut in different places
        one.submit(run_write(first, [b"%d" % seq for seq in range(first, first + 4)]))
        two.submit(run_write(max(1, first - 2), [b"%d" % seq for seq in range(max(1, first - 2), first + 4)]))
    await one.flush()
    await two.flush()
    found = [item for batch in await two.samples("r1") for item in batch.samples()]
    assert [(seq, payload) for seq, _, payload in found] == [(seq, b"%d" % seq) for seq in range(1, 401)]
    assert await one.streams("r1") == {(7, EPOCH): 400}
    await one.close()
    await two.close()


def test_a_store_that_cannot_be_used_is_said_without_the_password(tmp_path: Path, free_port: int) -> None:
    with pytest.raises(ConfigError, match=rf"postgresql://127.0.0.1:{free_port}/db cannot be used") as caught:
        open_store(tmp_path, f"postgresql://user:secret@127.0.0.1:{free_port}/db")
    assert "secret" not in str(caught.value)
    with pytest.raises(ConfigError, match="--store is a URL"):
        open_store(tmp_path, "mysql://x")
    asyncio.run(open_store(tmp_path).close())  # the directory is free again


async def test_a_database_that_cannot_be_read_is_a_store_error(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    store.start()
    assert isinstance(store._engine, SqliteEngine)
    store._engine.connection.execute("DROP TABLE writers")
    with pytest.raises(StoreError, match="writers"):
        await store.writers("r1")
    await store.close()
