"""The thread that compacts: on its own, when the object store is away, beside another gateway, on the wrong objects."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from typing import BinaryIO

import pytest

from gateway.errors import ObjectStoreError
from gateway.store import SampleFilter, Store
from gateway.store.engine import StoreEngine
from gateway.store.objects import DirectoryStore
from gateway.store.retention import Retention
from gateway.store.telemetry.compact import CompactPace
from gateway.store.telemetry.compactor import take_lease
from metaros.clock import SystemClock
from tests.gateway.store.samples import run_write
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until_async

QUICK = CompactPace(size_bytes=1000, small_bytes=0, age_s=0.0, look_every_s=0.01, retry_s=0.01, retry_most_s=0.05)
SECOND = 10**9


class AwayStore(DirectoryStore):
    """A directory that cannot be reached while `away`."""

    away = False

    def put(self, name: str, source: Path | BinaryIO, *, size_bytes: int, sha256: str) -> None:
        """Fails while away."""
        if self.away:
            raise ObjectStoreError("no route to the object store")
        super().put(name, source, size_bytes=size_bytes, sha256=sha256)


def open_store(folder: Path, objects: DirectoryStore, url: str = "", pace: CompactPace = QUICK) -> Store:
    retention = Retention(age_s=1e9, size_bytes=1 << 40)
    options = {"clock": SystemClock(), "retention": retention, "queue_bytes": 1 << 20, "url": url}
    return Store(folder, objects=objects, compact=pace, **options)  # type: ignore[arg-type]


def segments(objects: DirectoryStore) -> list[str]:
    return [info.name for info in objects.names("segments/")]


async def numbers(store: Store) -> list[int]:
    """What is stored of stream 7, by number; the payloads are checked."""
    found = []
    for run in await store.runs("r1", SampleFilter(stream_id=7), limit=100_000):
        for seq, _, data in (await store.load(run)).samples():
            assert data == b"%d" % seq
            found.append(seq)
    return sorted(found)


async def all_moved(store: Store) -> None:
    """Wait until every run lies in a segment."""
    for _ in range(6000):
        if all(run.place is not None for run in await store.runs("r1")):
            return
        await asyncio.sleep(0.01)
    raise AssertionError(f"batches are left: {store.objects_error}")


def submit(store: Store, first: int, count: int) -> None:
    for seq in range(first, first + count):
        store.submit(run_write(seq, [b"%d" % seq]))


async def test_messages_move_to_segments_while_more_come(tmp_path: Path, store_url: str) -> None:
    objects = DirectoryStore(tmp_path / "objects")
    store = open_store(tmp_path, objects, store_url)
    store.start()
    for first in range(1, 301, 50):
        submit(store, first, 50)
        await store.flush()
        assert await numbers(store) == list(range(1, first + 50))
    await wait_until_async(lambda: len(segments(objects)) > 1)
    await all_moved(store)
    assert await numbers(store) == list(range(1, 301))
    assert store.objects_error is None
    await store.close()
    again = open_store(tmp_path, objects, store_url)
    again.start()
    assert await numbers(again) == list(range(1, 301))
    (topic,) = await again.stored_topics("r1")
    assert (topic.topic, topic.delivery, topic.samples, topic.first_ns, topic.last_ns) == (
        "/events",
        "event",
        300,
        1001,
        1300,
    )
    await again.close()


async def test_batches_stay_while_the_object_store_is_away(tmp_path: Path) -> None:
    objects = AwayStore(tmp_path / "objects")
    objects.away = True
    store = open_store(tmp_path, objects)
    store.start()
    submit(store, 1, 20)
    await store.flush()
    await wait_until_async(lambda: store.objects_error is not None)
    assert "no route" in str(store.objects_error)
    assert store.error is None
    assert await numbers(store) == list(range(1, 21))
    objects.away = False
    await wait_until_async(lambda: store.objects_error is None and segments(objects))
    submit(store, 21, 10)
    await store.flush()
    assert await numbers(store) == list(range(1, 31))
    await store.close()


async def test_another_object_store_than_before_is_noticed(tmp_path: Path) -> None:
    first, second = DirectoryStore(tmp_path / "one"), DirectoryStore(tmp_path / "two")
    store = open_store(tmp_path, first)
    store.start()
    submit(store, 1, 5)
    await store.flush()
    await wait_until_async(lambda: segments(first))
    await store.close()
    other = open_store(tmp_path, second)
    other.start()
    submit(other, 6, 5)
    await other.flush()
    await wait_until_async(lambda: other.objects_error is not None)
    assert "--objects" in str(other.objects_error)
    assert list(second.names()) == []
    await other.close()
    back = open_store(tmp_path, first)
    back.start()
    assert await numbers(back) == list(range(1, 11))
    await wait_until_async(lambda: len(segments(first)) > 1)
    assert back.objects_error is None
    await back.close()


async def test_a_directory_whose_disk_was_unmounted_is_noticed(tmp_path: Path) -> None:
    """What is there then is an empty directory of that name."""
    objects = DirectoryStore(tmp_path / "objects")
    store = open_store(tmp_path, objects)
    store.start()
    submit(store, 1, 5)
    await store.flush()
    await all_moved(store)
    (tmp_path / "objects").rename(tmp_path / "elsewhere")
    submit(store, 6, 5)
    await store.flush()
    await wait_until_async(lambda: store.objects_error is not None)
    assert segments(objects) == []
    (tmp_path / "elsewhere").rename(tmp_path / "objects")
    await all_moved(store)
    assert await numbers(store) == list(range(1, 11))
    await wait_until_async(lambda: store.objects_error is None)
    await store.close()


async def test_two_gateways_compact_one_postgresql_store(tmp_path: Path, postgres: PostgresServer) -> None:
    """Without a lease that would keep them apart: both find the same batches, and neither doubles nor loses any."""
    url, objects = postgres.schema(), DirectoryStore(tmp_path / "objects")
    hasty = CompactPace(size_bytes=200, small_bytes=0, age_s=0.0, look_every_s=0.0, retry_s=0.001, lease_s=0.0)
    one, two = (open_store(tmp_path / name, objects, url, hasty) for name in ("1", "2"))
    one.start()
    two.start()
    for first in range(1, 401, 20):
        submit(one, first, 20)
        again = max(1, first - 5)
        submit(two, again, first + 20 - again)
        await one.flush()
        await two.flush()
        assert await numbers(two) == list(range(1, first + 20))
    await all_moved(one)
    assert await numbers(one) == list(range(1, 401))
    await one.close()
    await two.close()


@pytest.fixture
def transaction(engine: StoreEngine) -> Iterator[StoreEngine]:
    """An engine in an open transaction."""
    with engine.transaction(write=True):
        yield engine


def test_one_gateway_has_the_lease(transaction: StoreEngine) -> None:
    def take(name: str, at_s: float) -> bool:
        return take_lease(transaction, name, now_ns=round(at_s * SECOND), lease_s=30)

    assert take("a", 1000)
    assert not take("b", 1029)
    assert take("a", 1029)
    assert not take("b", 1058)
    assert take("b", 1060)
    assert not take("a", 1061)
    assert take("a", 500)  # a clock that was set back far must not stop compaction for hours


async def test_a_store_closes_while_the_object_store_hangs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.store.store.CLOSE_S", 0.2)

    class Hanging(DirectoryStore):
        reached = False

        def put(self, name: str, source: Path | BinaryIO, *, size_bytes: int, sha256: str) -> None:
            self.reached = True
            Event().wait(3600)

    objects = Hanging(tmp_path / "objects")
    store = open_store(tmp_path, objects)
    store.start()
    submit(store, 1, 5)
    await store.flush()
    await wait_until_async(lambda: objects.reached)
    await store.close()
    again = open_store(tmp_path, DirectoryStore(tmp_path / "others"))
    again.start()
    assert await numbers(again) == [1, 2, 3, 4, 5]
    await again.close()
