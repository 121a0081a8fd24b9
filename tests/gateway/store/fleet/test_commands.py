"""Commands' rows on both databases: idempotency, bounds, changes that happen once, pages, and the way out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from gateway.domain.errors import IdempotencyConflictError
from gateway.domain.fleet.command import CANCELLED, DELIVERED, DONE, ISSUED, Command, new_command_id
from gateway.domain.robot import Robot
from gateway.errors import TooManyError, UnknownRobotError
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.fleet.commands import (
    add_command,
    change_command,
    get_command,
    list_commands,
    open_commands,
    overdue_commands,
    purge_commands,
    waiting_robots,
)
from gateway.store.writes import RobotWrite

NOW_NS = 1_700_000_000 * 10**9
S = 10**9


def command(number: int, robot: str = "r1", **more: Any) -> Command:
    """A durable one; higher numbers are later."""
    values: dict[str, Any] = {
        "id": new_command_id(NOW_NS + number * S),
        "robot": robot,
        "kind": "publish",
        "request": '{"topic":"ü"}',
        "wire": b"\0wire",
        "issuer": "user:u1",
        "issued_by": "ann",
        "digest": "d",
        "durable": True,
        "timeout_ms": 10_000,
        "issued_ns": NOW_NS,
        "expires_ns": NOW_NS + 100 * S,
    }
    return Command(**{**values, **more})


@pytest.fixture
def robots(engine: StoreEngine) -> StoreEngine:
    Committer(engine).commit([RobotWrite(Robot("r1"), 1), RobotWrite(Robot("r2"), 1)], now_ns=1)
    return engine


def add(engine: StoreEngine, item: Command, *, most_open: int = 10) -> Command:
    with engine.transaction(write=True):
        return add_command(engine, item, most_open=most_open)


def change(engine: StoreEngine, item: Command, **values: Any) -> bool:
    with engine.transaction(write=True):
        return change_command(engine, item.id, **values)


def test_a_command_is_what_was_stored_and_its_key_is_its_issuer_s(robots: StoreEngine) -> None:
    first = command(1, idempotency="k")
    assert add(robots, first) == first
    with robots.transaction(write=False):
        assert get_command(robots, first.id) == first
    assert add(robots, command(2, idempotency="k")) == first
    assert add(robots, command(3, idempotency="k", issuer="user:u2")).issuer == "user:u2"
    with pytest.raises(IdempotencyConflictError):
        add(robots, command(4, idempotency="k", digest="other"))
    with pytest.raises(UnknownRobotError):
        add(robots, command(5, robot="nobody"))


def test_open_ones_are_bounded_by_robot(robots: StoreEngine) -> None:
    first = command(1)
    add(robots, first)
    add(robots, command(2), most_open=2)
    with pytest.raises(TooManyError):
        add(robots, command(3), most_open=2)
    add(robots, command(3, durable=False), most_open=2)
    add(robots, command(4, robot="r2"), most_open=2)
    assert change(robots, first, state=DONE, ended_ns=NOW_NS)
    add(robots, command(5), most_open=2)


def test_changes_happen_once(robots: StoreEngine) -> None:
    item = command(1)
    add(robots, item)
    assert change(robots, item, within=(ISSUED,), state=DELIVERED, delivered_ns=5)
    assert not change(robots, item, within=(ISSUED,), state=CANCELLED, ended_ns=6)
    assert change(robots, item, state=DONE, ended_ns=7, result='{"a": 1}')
    assert not change(robots, item, state=CANCELLED, ended_ns=8)
    with robots.transaction(write=False):
        found = get_command(robots, item.id)
    assert found == replace(item, state=DONE, delivered_ns=5, ended_ns=7, result='{"a": 1}')


def test_what_waits_and_what_time_ends(robots: StoreEngine) -> None:
    issued, left = command(1), command(2, state=DELIVERED)
    immediate = command(3, durable=False, expires_ns=0)
    for item in (issued, left, immediate, command(4, robot="r2", ended_ns=5, state=DONE)):
        add(robots, item)

    def overdue(after_s: int) -> list[str]:
        times = {"now_ns": NOW_NS + after_s * S, "silence_ns": 1000 * S, "immediate_ns": 60 * S}
        with robots.transaction(write=False):
            return [item.id for item in overdue_commands(robots, **times, limit=10)]

    with robots.transaction(write=False):
        assert waiting_robots(robots) == ["r1"]
        assert open_commands(robots, "r1", limit=10) == [issued, left]
        assert open_commands(robots, "r2", limit=10) == []
    assert overdue(50) == []
    assert overdue(70) == [immediate.id]
    assert overdue(100) == [issued.id, immediate.id]
    assert overdue(1100) == [issued.id, left.id, immediate.id]


def test_pages_and_the_way_out(robots: StoreEngine) -> None:
    items = [command(n, robot="r1" if n % 2 else "r2", state=DONE, ended_ns=NOW_NS + n * S) for n in range(6)]
    items[5] = replace(items[5], issuer="key:k", issued_by="robbie")
    for item in items:
        add(robots, item)
    ids = [item.id for item in items]

    def page(**filters: Any) -> list[str]:
        with robots.transaction(write=False):
            return [item.id for item in list_commands(robots, **{"limit": 10, **filters})]

    assert page() == ids[::-1]
    assert page(limit=2, before=ids[4]) == [ids[3], ids[2]]
    assert page(robot="r1") == [ids[5], ids[3], ids[1]]
    assert page(issuer="robbie") == page(issuer="key:k") == [ids[5]]
    assert page(state="failed") == []
    long = len(items[5].request) + len(items[5].wire) + len(items[5].result)
    assert page(most_bytes=2 * long) == [ids[5], ids[4]]
    assert page(most_bytes=0) == [ids[5]], "one at least, or nobody could go on"
    add(robots, command(9))
    with robots.transaction(write=True):
        assert purge_commands(robots, before_ns=NOW_NS + 2 * S, most=100) == 2
        assert purge_commands(robots, before_ns=0, most=3) == 2
        assert purge_commands(robots, before_ns=0, most=3) == 0
    assert page()[1:] == [ids[5], ids[4]]
