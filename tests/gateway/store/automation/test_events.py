"""The journal's rows: numbers without holes, reading both ways, purging from the oldest on."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from gateway.domain.automation.event import Event
from gateway.errors import StoreError
from gateway.store.automation.events import add_events, event_bounds, newest_events, purge_events, read_events
from gateway.store.engine import StoreEngine


def some(count: int, *, robot: str = "r1", at_ns: int = 1) -> list[Event]:
    """Events as they wait: without numbers."""
    return [Event(seq=0, kind="robot.online", robot=robot, at_ns=at_ns, gateway="g1") for _ in range(count)]


def add(engine: StoreEngine, events: list[Event]) -> int:
    """Append in a transaction."""
    with engine.transaction(write=True):
        return add_events(engine, events)


def numbers(events: list[Event]) -> list[int]:
    """Of events, their numbers."""
    return [item.seq for item in events]


def test_events_are_numbered_without_holes_and_read_both_ways(engine: StoreEngine) -> None:
    assert add(engine, some(3)) == 3
    assert add(engine, some(2, robot="r2")) == 5
    with engine.transaction(write=False):
        assert numbers(read_events(engine, after=0, limit=10)) == [1, 2, 3, 4, 5]
        assert numbers(read_events(engine, after=2, limit=2)) == [3, 4]
        assert numbers(read_events(engine, after=0, robots=["r2"], limit=10)) == [4, 5]
        assert numbers(newest_events(engine, before=6, limit=2)) == [5, 4]
        assert numbers(newest_events(engine, before=6, robots=["r1", "r3"], limit=2)) == [3, 2]
        assert event_bounds(engine) == (1, 5)


def test_a_transaction_that_fails_gives_no_number_away(engine: StoreEngine) -> None:
    add(engine, some(2))

    def fail() -> None:
        with engine.transaction(write=True):
            add_events(engine, some(2))
            raise StoreError("a fault")

    with pytest.raises(StoreError):
        fail()
    assert add(engine, some(1)) == 3


def test_two_connections_give_no_number_twice(connect: Callable[[], StoreEngine]) -> None:
    engines = [connect(), connect()]

    def work(engine: StoreEngine) -> None:
        for _ in range(20):
            add(engine, some(3))

    if not engines[0].shared:  # one writer: that is what SQLite is chosen for
        work(engines[0])
        work(engines[0])
    else:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(work, engines))
    with engines[0].transaction(write=False):
        assert numbers(read_events(engines[0], after=0, limit=1000)) == list(range(1, 121))


def test_the_oldest_go_by_age_and_by_count_and_numbers_go_on(engine: StoreEngine) -> None:
    add(engine, some(3, at_ns=10))
    add(engine, some(4, at_ns=20))
    with engine.transaction(write=True):
        assert purge_events(engine, before_ns=20, most=100) == 3
        assert purge_events(engine, before_ns=20, most=100) == 0
        assert event_bounds(engine) == (4, 7)
        assert purge_events(engine, before_ns=0, most=2) == 2
        assert numbers(read_events(engine, after=0, limit=9)) == [6, 7]
        assert purge_events(engine, before_ns=99, most=2) == 2
        assert event_bounds(engine) == (8, 7)
    assert add(engine, some(1)) == 8
