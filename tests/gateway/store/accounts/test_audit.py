"""The audit log's chain on both databases: whatever is changed, removed or put in another place is found."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from gateway.errors import StoreError
from gateway.store.accounts.audit import AuditEvent, append, read_head, read_page
from gateway.store.engine import StoreEngine, placeholders
from gateway.store.ledger import in_transaction
from tests.gateway.store.audit_log import COLUMNS, ROWS, event, prove, tamper


@pytest.fixture
def log(engine: StoreEngine) -> StoreEngine:
    """A log of a few rows, written in two transactions."""
    for some in (range(1, 4), range(4, ROWS + 1)):
        in_transaction(engine)(lambda writing, some=some: append(writing, [event(number) for number in some]))
    assert prove(engine) == []
    return engine


def found(log: StoreEngine, *statements: str) -> list[tuple[int, str]]:
    """What the proof says of a log that was changed like this; then it is as it was."""
    with log.transaction(write=False):
        rows, (head,) = log.fetch("SELECT * FROM audit"), log.fetch("SELECT number, hash FROM audit_head")
    tamper(log, *statements)
    faults = prove(log)
    with log.transaction(write=True):
        log.execute("DELETE FROM audit")
        log.many(f"INSERT INTO audit VALUES ({placeholders(len(rows[0]))})", rows)
        log.execute("UPDATE audit_head SET number = ?, hash = ?", *head)
    return [(fault.number, fault.fault) for fault in faults]


def swap(one: int, other: int) -> list[str]:
    """Two rows change places."""
    places = ((99, one), (one, other), (other, 99))
    return [f"UPDATE audit SET number = {to} WHERE number = {number}" for to, number in places]


def test_whatever_is_changed_is_found(log: StoreEngine) -> None:
    change = {name: f"{name} + 100" if name in ("number", "at_ns", "status") else f"{name} || ' '" for name in COLUMNS}
    others = ", ".join(COLUMNS[1:])
    changes = {
        **{
            f"{name} of {number}": [f"UPDATE audit SET {name} = {value} WHERE number = {number}"]
            for name, value in change.items()
            for number in (1, 4, ROWS)
        },
        **{f"{number} removed": [f"DELETE FROM audit WHERE number = {number}"] for number in range(1, ROWS + 1)},
        "3 removed and the rest numbered anew": [
            "DELETE FROM audit WHERE number = 3",
            *(f"UPDATE audit SET number = {number - 1} WHERE number = {number}" for number in range(4, ROWS + 1)),
            f"UPDATE audit_head SET number = {ROWS - 1}",
        ],
        **{f"{one} and {other} swapped": swap(one, other) for one, other in ((1, 2), (2, 6), (6, ROWS))},
        **{
            f"{number} put in": [
                f"INSERT INTO audit (number, {others}) SELECT {number}, {others} FROM audit WHERE number = 2"
            ]
            for number in (-3, 0, ROWS + 1, ROWS + 2)
        },
    }
    assert [name for name, statements in changes.items() if not found(log, *statements)] == []
    assert prove(log) == []


def test_a_fault_is_named(log: StoreEngine) -> None:
    assert found(log, "UPDATE audit SET name = 'somebody' WHERE number = 5") == [(5, "hash")]
    cut = (f"DELETE FROM audit WHERE number = {ROWS}", f"UPDATE audit_head SET number = {ROWS - 1}")
    assert [fault for _, fault in found(log, *cut)] == ["head"]


def test_a_row_cannot_be_changed_by_mistake(log: StoreEngine) -> None:
    for statement in ("UPDATE audit SET name = 'x' WHERE number = 2", "DELETE FROM audit WHERE number = 2"):
        with pytest.raises(StoreError, match="append-only"):
            in_transaction(log)(lambda engine, statement=statement: engine.execute(statement))
    assert prove(log) == []


def test_several_gateways_write_one_chain(connect: Callable[[], StoreEngine]) -> None:
    engines = [connect() for _ in range(3)]

    def work(number: int) -> None:
        run = in_transaction(engines[number])
        for turn in range(20):
            some = [event(100 * number + turn)] * (1 + turn % 3)
            run(lambda engine, some=some: append(engine, some))

    with ThreadPoolExecutor(3) as pool:
        list(pool.map(work, range(3)))
    written = 3 * sum(1 + turn % 3 for turn in range(20))
    assert read_head(engines[0]).number == written
    assert prove(engines[0], step=50) == []
    assert len(read_page(engines[1], limit=1000)) == written


def test_pages(log: StoreEngine) -> None:
    newest = read_page(log, limit=3)
    assert [row.number for row in newest] == [7, 6, 5]
    assert newest[0].event == event(7)
    assert [row.number for row in read_page(log, before=5, limit=9)] == [4, 3, 2, 1]
    assert [row.number for row in read_page(log, limit=9, action="action 2")] == [2]
    assert [row.number for row in read_page(log, limit=9, name="name 3", action="action 2")] == []
    assert [row.number for row in read_page(log, limit=9, name="name 3", before=4)] == [3]


def test_what_a_client_sends_can_be_stored(engine: StoreEngine) -> None:
    odd = AuditEvent(at_ns=1, target="/a\x00b\nc\ud800" + "x" * 9000, name="\u202eeve", detail="é漢" * 900)
    in_transaction(engine)(lambda writing: append(writing, [odd]))
    stored = read_page(engine, limit=1)[0].event
    assert stored.target.startswith("/a\ufffdb\ufffdc")
    assert (len(stored.target), len(stored.detail)) == (512, 1000)
    assert "\u202e" not in stored.name
    assert prove(engine) == []
