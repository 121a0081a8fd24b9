"""The log of a running gateway: its bounds, a database that is away, and an end that loses nothing."""

from __future__ import annotations

import asyncio
import sqlite3
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.errors import StoreError, TooManyError
from gateway.identity import audit
from gateway.identity.audit import HOUR_S, AuditLog
from gateway.store import Store
from gateway.store.accounts.audit_heads import head_names
from gateway.store.objects import open_objects
from gateway.store.retention import Retention
from metaros.clock import Clock, ManualClock
from metaros.limits import LIMITS
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until_async

SMALL = replace(LIMITS, audit_queue=3, audit_refusals_per_hour=5)


@asynccontextmanager
async def open_log(folder: Path, *, url: str = "", clock: Clock | None = None) -> AsyncIterator[tuple[AuditLog, Store]]:
    """A log on a store, both closed afterwards as the gateway closes them."""
    clock = clock or ManualClock()
    retention = Retention(age_s=1000.0, size_bytes=1 << 30)
    store = Store(folder / "data", clock=clock, retention=retention, queue_bytes=1 << 20, url=url)
    store.start()
    log = AuditLog(store, open_objects("", folder), clock=clock, limits=SMALL)
    try:
        yield log, store
    finally:
        await log.close()
        await store.close()


async def test_two_gateways_on_one_store(tmp_path: Path, postgres: PostgresServer) -> None:
    store_url = postgres.schema()
    async with open_log(tmp_path / "a", url=store_url) as (one, _), open_log(tmp_path / "b", url=store_url) as (two, _):
        for _ in range(10):
            await asyncio.gather(one.record(action="x"), two.record(action="y"), one.record(action="z"))
        found = await two.verify()
        assert (found["ok"], found["rows"]) == (True, 30)
        gateways = {row.event.gateway for row in await one.page(limit=100)}
        assert len(gateways) == 2


async def test_of_too_many_refusals_the_number_is_kept(tmp_path: Path) -> None:
    clock = ManualClock()
    async with open_log(tmp_path, clock=clock) as (log, _):
        for _ in range(9):
            log.refuse(action="robots.read", code="sign_in")
            await log.head()  # written
        assert (await log.head()).number == 5
        clock.advance(HOUR_S)
        log.refuse(action="robots.read", code="sign_in")
        newest = await log.page(limit=2)
        assert [row.event.action for row in newest] == ["robots.read", "refusals"]
        assert newest[1].event.detail.startswith("4 refusals")


async def test_while_the_database_is_away_rows_wait_and_then_nothing_changes(tmp_path: Path) -> None:
    async with open_log(tmp_path) as (log, _):
        await log.record(action="first")
        with sqlite3.connect(tmp_path / "data" / "gateway.sqlite") as other:
            other.execute("ALTER TABLE audit RENAME TO away")
        for number in range(SMALL.audit_queue):
            await log.record(action=f"waiting {number}", wait_s=0.01)
        with pytest.raises(StoreError, match="wait for the database"):
            await log.record(action="too much")
        log.refuse(action="refused")  # counted only
        with sqlite3.connect(tmp_path / "data" / "gateway.sqlite") as other:
            other.execute("ALTER TABLE away RENAME TO audit")
        await wait_until_async(lambda: not log._waiting)
        rows = await log.page(limit=9)
        assert [row.event.action for row in rows] == ["waiting 2", "waiting 1", "waiting 0", "first"]
        assert (await log.verify())["ok"]
        other.close()


async def test_the_end_writes_what_waits_and_exports_the_head(tmp_path: Path) -> None:
    async with open_log(tmp_path) as (log, _):
        log.add(action="last")
    async with open_log(tmp_path) as (log, _):
        found = await log.verify()
        assert (found["ok"], found["rows"], found["heads"], found["heads_sealed"]) == (True, 1, 1, 0)


async def test_the_head_is_exported_every_hour(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "EXPORT_S", 0.01)
    async with open_log(tmp_path) as (log, _):
        running = asyncio.create_task(log.run())
        heads, objects = [], open_objects("", tmp_path)
        for number in range(1, 3):
            await log.record(action="x")
            await wait_until_async(lambda number=number: len(head_names(objects, limit=9)) == number)
            heads.append((await log.verify())["heads"])
        running.cancel()
        assert heads == [1, 2]


async def test_one_proof_at_a_time(tmp_path: Path) -> None:
    async with open_log(tmp_path) as (log, _):
        await log.record(action="x")
        both = await asyncio.gather(log.verify(), log.verify(), return_exceptions=True)
        assert both[0]["ok"]
        assert isinstance(both[1], TooManyError)
        assert (await log.verify())["ok"]
