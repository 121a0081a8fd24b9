"""The journal: order, cursors, who may see what, what is lost is said, and two gateways on one store."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson
import pytest

from gateway.automation.events import journal as module
from gateway.automation.events.cloud import cloud_event
from gateway.automation.events.journal import EventJournal
from gateway.domain.automation.event import Event, EventFilter, EventPage
from gateway.errors import StoreError
from gateway.store import Store
from gateway.store.retention import Retention
from metaros.clock import Clock, ManualClock
from metaros.limits import LIMITS
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until_async


@asynccontextmanager
async def open_store(folder: Path, *, url: str = "", clock: Clock | None = None) -> AsyncIterator[Store]:
    """A store, closed afterwards."""
    retention = Retention(age_s=1000.0, size_bytes=1 << 30)
    store = Store(folder / "data", clock=clock or ManualClock(), retention=retention, queue_bytes=1 << 20, url=url)
    store.start()
    try:
        yield store
    finally:
        await store.close()


@asynccontextmanager
async def open_journal(
    folder: Path, *, url: str = "", clock: Clock | None = None, **limits: Any
) -> AsyncIterator[EventJournal]:
    """A running journal on a store, both closed afterwards as the gateway closes them."""
    clock = clock or ManualClock()
    async with open_store(folder, url=url, clock=clock) as store:
        journal = EventJournal(store, clock=clock, limits=replace(LIMITS, **limits))
        await journal.start()
        running = asyncio.create_task(journal.run())
        try:
            yield journal
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            await journal.close()


async def stored(journal: EventJournal, seq: int) -> None:
    """Wait until the journal has come to a number."""
    await wait_until_async(lambda: journal.head >= seq)


def reported(page: EventPage) -> list[tuple[int, str, str]]:
    """What a page holds, in short."""
    return [(item.seq, item.kind, item.robot) for item in page.events]


async def test_events_come_in_order_and_a_page_goes_on_where_the_last_ended(tmp_path: Path) -> None:
    async with open_journal(tmp_path) as journal:
        for number in range(5):
            journal.emit("robot.online", f"r{number}", {"hostname": "h"})
        await stored(journal, 5)
        first = await journal.read(after=0, limit=3)
        assert reported(first) == [(1, "robot.online", "r0"), (2, "robot.online", "r1"), (3, "robot.online", "r2")]
        rest = await journal.read(after=first.next, limit=3)
        assert [item.seq for item in rest.events] == [4, 5]
        assert (await journal.read(after=rest.next, limit=3)).events == ()
        newest = await journal.read(after=None, limit=2)
        assert [item.seq for item in newest.events] == [5, 4]
        older = await journal.read(after=None, before=newest.next, limit=9)
        assert ([item.seq for item in older.events], older.next) == ([3, 2, 1], 0)


async def test_a_filter_is_by_kind_by_robot_and_by_scope(tmp_path: Path) -> None:
    async with open_journal(tmp_path) as journal:
        journal.emit("robot.online", "r1")
        journal.emit("robot.offline", "r2")
        journal.emit("rollout.changed", "", {"rollout": "x"})
        journal.emit("node.crashed", "r1", {"node": "camera"})
        await stored(journal, 4)

        async def seqs(**wanted: Any) -> list[int]:
            page = await journal.read(after=0, limit=10, wanted=EventFilter(**wanted))
            assert page.next == 4  # looked through to the end, whatever matched
            return [item.seq for item in page.events]

        assert await seqs(kinds=("robot.*",)) == [1, 2]
        assert await seqs(robots=("r1",)) == [1, 4]
        assert await seqs(sees=lambda robot: robot == "r1", sees_fleet=False) == [1, 4]
        assert await seqs(sees=lambda robot: robot == "r2") == [2, 3]


async def test_a_watcher_hears_what_follows_its_cursor_and_then_what_happens(tmp_path: Path) -> None:
    async with open_journal(tmp_path) as journal:
        journal.emit("robot.online", "r1")
        journal.emit("robot.online", "r2")
        await stored(journal, 2)
        after, now = journal.watch(after=1), journal.watch()
        assert reported(await anext(after)) == [(2, "robot.online", "r2")]
        waiting = asyncio.create_task(anext(now))
        await wait_until_async(lambda: journal.watchers == 2)
        await asyncio.sleep(0)
        journal.emit("robot.offline", "r1")
        assert [item.kind for item in (await anext(after)).events] == ["robot.offline"]
        journal.emit("robot.offline", "r2")
        assert (await waiting).events[0].robot in ("r1", "r2")
        await after.aclose()
        await now.aclose()
        assert journal.watchers == 0


async def test_who_lags_reads_on_from_the_store_without_a_hole(tmp_path: Path) -> None:
    async with open_journal(tmp_path, events_in_memory=3) as journal:
        watching = journal.watch(after=0)
        for number in range(40):
            journal.emit("robot.online", f"r{number}")
        await stored(journal, 40)
        seen: list[int] = []
        while len(seen) < 40:
            seen += [item.seq for item in (await anext(watching)).events]
        assert seen == list(range(1, 41))
        await watching.aclose()


async def test_what_was_purged_behind_a_cursor_is_said(tmp_path: Path) -> None:
    async with open_journal(tmp_path, events_kept=5, events_in_memory=2) as journal:
        for number in range(12):
            journal.emit("robot.online", f"r{number}")
        await stored(journal, 12)
        await journal.purge()
        page = await journal.read(after=2, limit=100)
        assert (page.lost, [item.seq for item in page.events]) == (5, [8, 9, 10, 11, 12])
        watching = journal.watch(after=2)
        assert (await anext(watching)).lost == 5
        await watching.aclose()


async def test_a_cursor_from_the_future_is_the_present(tmp_path: Path) -> None:
    async with open_journal(tmp_path) as journal:
        journal.emit("robot.online", "r1")
        await stored(journal, 1)
        watching = journal.watch(after=10**15)
        waiting = asyncio.create_task(anext(watching))
        await wait_until_async(lambda: journal.watchers == 1)
        for number in range(2, 6):
            journal.emit("robot.online", f"r{number}")
            await stored(journal, number)
        assert (await waiting).events[0].seq in (2, 3, 4, 5)
        await watching.aclose()


async def test_of_too_many_the_number_is_kept_and_a_long_one_is_cut(tmp_path: Path) -> None:
    async with open_journal(tmp_path, events_waiting=4, event_bytes=100) as journal:
        journal.emit("twin.refused", "r1", {"message": "x" * 200})
        for number in range(9):
            journal.emit("robot.online", f"r{number}")
        await stored(journal, 5)
        page = await journal.read(after=0, limit=100)
        assert [item.kind for item in page.events][-1] == "journal.lost"
        assert orjson.loads(page.events[-1].data) == {"count": 6}
        assert orjson.loads(page.events[0].data) == {"truncated": True, "size_bytes": 214}
        with pytest.raises(KeyError):
            journal.emit("robot.exploded", "r1")


async def test_while_the_store_is_away_events_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "RETRY_S", 0.01)
    monkeypatch.setattr(module, "GATHER_S", 0.0)
    async with open_journal(tmp_path) as journal:
        real, away, tries = journal._database.run, [True], 0

        async def run(job: Callable[[Any], Any]) -> Any:
            nonlocal tries
            if away[0]:
                tries += 1
                raise StoreError("the disk is full")
            return await real(job)

        monkeypatch.setattr(journal._database, "run", run)
        journal.emit("robot.online", "r1")
        journal.emit("robot.offline", "r1")
        await wait_until_async(lambda: tries >= 2, every_s=0.001)  # it tries again by itself
        assert journal.waiting == 2
        away[0] = False
        await stored(journal, 2)
        assert journal.waiting == 0


async def test_an_end_stores_what_was_reported_last(tmp_path: Path) -> None:
    async with open_journal(tmp_path) as journal:
        journal.emit("robot.offline", "r1")
    async with open_journal(tmp_path) as journal:
        assert reported(await journal.read(after=0, limit=5)) == [(1, "robot.offline", "r1")]


async def test_what_is_under_way_at_the_end_is_stored_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    committed, go_on = asyncio.Event(), asyncio.Event()

    async def slow(store: Store, job: Any) -> Any:
        answer = await run(store, job)
        committed.set()
        await go_on.wait()
        return answer

    async with open_journal(tmp_path) as journal:
        run = Store.run
        monkeypatch.setattr(Store, "run", slow)
        journal.emit("robot.offline", "r1")
        await committed.wait()
        asyncio.get_running_loop().call_soon(go_on.set)  # when `run` is cancelled already
    async with open_journal(tmp_path) as journal:
        assert reported(await journal.read(after=0, limit=5)) == [(1, "robot.offline", "r1")]


async def test_who_watches_is_sent_home_when_the_gateway_ends(tmp_path: Path) -> None:
    async with open_journal(tmp_path) as journal:
        journal.emit("robot.online", "r1")
        await stored(journal, 1)
        watching = journal.watch(after=0)
        assert (await anext(watching)).next == 1
        waiting = asyncio.create_task(anext(watching))
        await asyncio.sleep(0)
        journal.end()
        with pytest.raises(StopAsyncIteration):
            await asyncio.wait_for(waiting, 60)


async def test_of_many_events_of_another_gateway_none_is_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that nobody watched is far behind; a look learns the newest alone, and the rest is read from the store."""
    monkeypatch.setattr(module, "BATCH", 4)
    async with open_store(tmp_path) as store:
        ours, theirs = EventJournal(store, clock=ManualClock()), EventJournal(store, clock=ManualClock())
        for journal, count in ((ours, 3), (theirs, 20)):
            for number in range(count):
                journal.emit("robot.online", f"r{number}")
            await journal.close()
        await ours.refresh()
        assert ours.head == 23
        page = await ours.read(after=0, limit=100)
        seen = [item.seq for item in page.events]
        while page.next < 23:
            page = await ours.read(after=page.next, limit=100)
            seen += [item.seq for item in page.events]
        assert seen == list(range(1, 24))


async def test_two_gateways_of_one_store_tell_each_others_events(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    async with open_journal(tmp_path / "a", url=url) as one, open_journal(tmp_path / "b", url=url) as two:
        watching = two.watch(after=0)
        for number in range(30):
            one.emit("robot.online", f"a{number}")
            two.emit("robot.online", f"b{number}")
        seen: list[Event] = []
        async with asyncio.timeout(60):
            while len(seen) < 60:
                seen += (await anext(watching)).events
        assert [item.seq for item in seen] == list(range(1, 61))
        assert len({item.gateway for item in seen}) == 2
        await watching.aclose()


def test_a_cloud_event_has_what_the_specification_asks_for() -> None:
    event = Event(seq=7, kind="node.crashed", robot="r1", at_ns=1_700_000_000_123_000_000, gateway="g", data='{"a":1}')
    assert cloud_event(event) == {
        "specversion": "1.0",
        "id": "7",
        "source": "/api/v1/robots/r1",
        "type": "metaros.node.crashed",
        "subject": "r1",
        "time": "2023-11-14T22:13:20.123Z",
        "datacontenttype": "application/json",
        "gateway": "g",
        "data": {"a": 1},
    }
    assert "subject" not in cloud_event(replace(event, robot=""))
