"""Whose robots' detectors are: of two gateways one has them, and what a former one still writes does not count."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gateway.store.alerting.watch_states import (
    Saved,
    drop_states,
    free_all,
    held_by,
    orphans,
    read_state,
    save_states,
    take_states,
)
from gateway.store.engine import StoreEngine
from gateway.store.fleet.presence import say_alive

NOW = 1_700_000_000 * 10**9
S = 10**9
STATE = Saved(
    robot="r1", fence=1, version=1, saved_ns=NOW, newest_ns=-5, marks={(0, (1 << 64) - 1): 7}, state=b"\0learned\xff"
)


def take(engine: StoreEngine, gateway: str, *robots: str, at: int = NOW, force: bool = False) -> dict[str, int]:
    with engine.transaction(write=True):
        say_alive(engine, gateway, until_ns=at + 10 * S)
        return take_states(engine, robots, gateway, now_ns=at, force=force)


def save(engine: StoreEngine, gateway: str, state: Saved, *, free: bool = False) -> set[str]:
    with engine.transaction(write=True):
        return save_states(engine, gateway, [state], free=free)


def stored(engine: StoreEngine, robot: str = "r1") -> Saved | None:
    with engine.transaction(write=False):
        return read_state(engine, robot)


def test_of_two_who_want_a_robot_one_gets_it_until_it_is_dead(connect: Callable[[], StoreEngine]) -> None:
    here, there = connect(), connect()
    assert take(here, "a", "r1", "r2") == {"r1": 1, "r2": 1}
    assert take(there, "b", "r1", "r3") == {"r3": 1}
    assert take(here, "a", "r1") == {"r1": 1}  # its own already: nothing changes
    assert take(there, "b", "r1", at=NOW + 9 * S) == {}
    assert take(there, "b", "r1", at=NOW + 11 * S) == {"r1": 2}
    with here.transaction(write=False):
        assert (held_by(here, "a"), held_by(here, "b")) == ({"r2": 1}, {"r1": 2, "r3": 1})


def test_what_a_former_owner_saves_does_not_count(connect: Callable[[], StoreEngine]) -> None:
    here, there = connect(), connect()
    take(here, "a", "r1")
    assert save(here, "a", STATE) == {"r1"}
    assert stored(there) == STATE
    assert take(there, "b", "r1", force=True) == {"r1": 2}
    assert save(here, "a", replace(STATE, state=b"late")) == set()
    assert stored(there) == replace(STATE, fence=2)
    assert take(here, "a", "r1", force=True) == {"r1": 3}
    assert save(here, "a", replace(STATE, state=b"of the life before")) == set()
    assert save(here, "a", replace(STATE, fence=3, state=b"now")) == {"r1"}


def test_a_robot_that_is_let_go_is_anybodys(connect: Callable[[], StoreEngine]) -> None:
    here, there = connect(), connect()
    take(here, "a", "r1")
    assert save(here, "a", STATE, free=True) == {"r1"}
    with there.transaction(write=False):
        assert orphans(there, now_ns=NOW) == ["r1"]
    assert take(there, "b", "r1") == {"r1": 2}
    assert stored(there) == replace(STATE, fence=2)


def test_orphans_are_those_of_nobody_who_lives(connect: Callable[[], StoreEngine]) -> None:
    here, there = connect(), connect()
    take(here, "a", "r1")
    take(there, "b", "r2", at=NOW + 5 * S)
    with there.transaction(write=False):
        assert orphans(there, now_ns=NOW) == []
        assert orphans(there, now_ns=NOW + 11 * S) == ["r1"]
    with there.transaction(write=True):
        free_all(there, "b")
    with there.transaction(write=False):
        assert orphans(there, now_ns=NOW) == ["r2"]
    with there.transaction(write=True):
        drop_states(there, ["r2"])
    assert stored(there, "r2") is None


def test_a_life_that_was_killed_does_not_write_into_the_next_one(connect: Callable[[], StoreEngine]) -> None:
    here, again = connect(), connect()
    take(here, "a", "r1")
    with again.transaction(write=True):
        free_all(again, "a")
    assert take(again, "a", "r1") == {"r1": 3}
    assert save(here, "a", STATE) == set()
    assert stored(again) == Saved(robot="r1", fence=3, version=0, saved_ns=0, newest_ns=0, marks={}, state=b"")
