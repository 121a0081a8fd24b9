"""The whole store on a real S3 server that is cut off, killed and refuses: nothing is lost, nothing is left over.

Each on one database; `test_compact.py` has an error after each step on both.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gateway.store import SampleFilter, Store
from gateway.store.engine import StoreEngine
from gateway.store.engines import open_engine
from gateway.store.integrity.check import Report, check
from gateway.store.ledger import LEASE_S, in_transaction, sweep_objects
from gateway.store.objects import ObjectStore, open_objects
from gateway.store.retention import Retention
from gateway.store.telemetry.compact import CompactPace
from metaros.clock import SystemClock
from tests.gateway.store.samples import run_write
from tests.support.servers.cutting_proxy import CuttingProxy
from tests.support.servers.seaweed import SeaweedServer
from tests.support.waiting import wait_until_async

pytestmark = pytest.mark.integration

QUICK = CompactPace(size_bytes=1 << 20, small_bytes=0, age_s=0.0, look_every_s=0.05, retry_s=0.05, retry_most_s=0.5)
CLOCK = SystemClock()


def message(seq: int) -> bytes:
    """100 kB that nobody compresses."""
    return np.random.default_rng(seq).bytes(100_000)


def open_store(folder: Path, objects: ObjectStore, url: str) -> Store:
    """A store that compacts as fast as it can."""
    retention = Retention(age_s=1e9, size_bytes=1 << 40)
    return Store(
        folder, clock=CLOCK, retention=retention, queue_bytes=64 << 20, url=url, objects=objects, compact=QUICK
    )


async def submit(store: Store, first: int, count: int) -> None:
    """Messages of 100 kB, committed."""
    for seq in range(first, first + count):
        store.submit(run_write(seq, [message(seq)]))
    await store.flush()


async def numbers(store: Store) -> list[int]:
    """What is stored, read and compared."""
    found = []
    for run in await store.runs("r1", SampleFilter(stream_id=7), limit=10_000):
        for seq, _, data in (await store.load(run)).samples():
            assert data == message(seq)
            found.append(seq)
    return sorted(found)


async def moved(store: Store, objects: ObjectStore) -> Report:
    """Wait until all is compacted; what the check says then, once what failed was swept."""
    for _ in range(3000):
        if all(run.place is not None for run in await store.runs("r1", limit=10_000)):
            break
        await asyncio.sleep(0.02)

    def look(engine: StoreEngine) -> Report:
        return check(engine, objects, deep=True, now_ns=CLOCK.wall_ns())

    return await store.read(look)


@pytest.mark.parametrize("store_url", ["postgres"], indirect=True)
async def test_a_server_that_is_killed_while_it_is_written_to(
    seaweed: SeaweedServer, s3_url: Callable[..., str], tmp_path: Path, store_url: str
) -> None:
    objects = open_objects(s3_url(), tmp_path)
    store = open_store(tmp_path, objects, store_url)
    store.start()
    try:
        await submit(store, 1, 30)
        seaweed.kill()
        await submit(store, 31, 30)  # robots go on, and are acknowledged
        await wait_until_async(lambda: store.objects_error is not None)
        seaweed.start()
        report = await moved(store, objects)
        assert await numbers(store) == list(range(1, 61))
        assert (report.damage, report.orphans) == ([], [])
        assert report.objects > 1
        await wait_until_async(lambda: store.objects_error is None)
    finally:
        if seaweed.process is None:
            seaweed.start()
        await store.close()
        objects.close()


@pytest.mark.parametrize("store_url", ["sqlite"], indirect=True)
async def test_a_line_that_is_cut_again_and_again(s3_url: Callable[..., str], tmp_path: Path, store_url: str) -> None:
    sure = open_objects(s3_url(), tmp_path)
    with CuttingProxy(int(s3_url().rpartition(":")[2])) as proxy:
        objects = open_objects(s3_url(port=proxy.port), tmp_path)
        store = open_store(tmp_path, objects, store_url)
        store.start()
        try:
            for turn, cut_bytes in enumerate((500, 700_000, 90_000, 1_500_000)):
                proxy.cut_after(up=cut_bytes)
                await submit(store, 1 + 20 * turn, 20)
                await wait_until_async(lambda turn=turn: proxy.cuts == turn + 1)  # type: ignore[misc]
                await wait_until_async(lambda: store.objects_error is not None)
                proxy.mend()
                report = await moved(store, sure)
                assert (report.damage, report.orphans) == ([], [])
            assert await numbers(store) == list(range(1, 81))
        finally:
            await store.close()
            objects.close()
    leftovers_go(tmp_path, sure, store_url)
    sure.close()


def leftovers_go(folder: Path, objects: ObjectStore, store_url: str) -> None:
    """After the leases only objects that the ledger has as stored are there, and no upload is left half way."""
    engine, _ = open_engine(store_url, folder)
    try:
        later_ns = CLOCK.wall_ns() + round(2.5 * LEASE_S * 1e9)
        for later in (later_ns, 2 * later_ns):
            sweep_objects(in_transaction(engine), objects, now_ns=later)
        with engine.transaction(write=False):
            rows = engine.fetch("SELECT name, state FROM objects")
    finally:
        engine.close()
    assert {row[1] for row in rows} == {"stored"}
    assert {info.name for info in objects.names()} == {row[0] for row in rows}
    assert objects.sweep(before_ns=later_ns) == 0
