"""Exported heads: a chain that was written anew, however well, is not the one that was exported."""

from __future__ import annotations

from pathlib import Path

import orjson
import pytest

from gateway.identity.master import MasterKey
from gateway.store.accounts.audit import AuditEvent, append
from gateway.store.accounts.audit_heads import check_heads, export_head, head_names
from gateway.store.engine import StoreEngine
from gateway.store.integrity.check import check
from gateway.store.ledger import in_transaction
from gateway.store.objects import ObjectStore, open_objects
from tests.gateway.store.audit_log import ROWS, event, prove, tamper

NOW_NS = 10**18
KEY = MasterKey(b"k" * 32)


@pytest.fixture
def objects(tmp_path: Path) -> ObjectStore:
    """A folder."""
    return open_objects("", tmp_path)


def export(engine: StoreEngine, objects: ObjectStore) -> int | None:
    head = export_head(engine, in_transaction(engine), objects, gateway="g", now_ns=NOW_NS, seal=KEY)
    return head.number if head is not None else None


def write(engine: StoreEngine, *numbers: int) -> None:
    in_transaction(engine)(lambda writing: append(writing, [event(number) for number in numbers]))


def test_a_head_is_exported_once(engine: StoreEngine, objects: ObjectStore) -> None:
    assert export(engine, objects) is None
    write(engine, 1, 2)
    assert export(engine, objects) == 2
    assert export(engine, objects) is None
    write(engine, 3)
    assert export(engine, objects) == 3
    report = check_heads(engine, objects, limit=10, seal=KEY)
    assert (report.checked, report.sealed, report.faults) == (2, 2, [])
    assert check_heads(engine, objects, limit=1).checked == 1
    looked = check(engine, objects, deep=True, now_ns=NOW_NS, on_object=lambda done, total: None)
    assert (looked.damage, looked.orphans) == ([], [])


def rewrite(engine: StoreEngine, *events: AuditEvent) -> None:
    """A new chain, as good as the first."""
    tamper(engine, "DELETE FROM audit", "UPDATE audit_head SET number = 0, hash = ''")
    in_transaction(engine)(lambda writing: append(writing, list(events)))
    assert prove(engine) == []


def test_a_chain_that_was_written_anew(engine: StoreEngine, objects: ObjectStore) -> None:
    write(engine, *range(1, ROWS + 1))
    export(engine, objects)
    rewrite(engine, *(event(99 if number == 4 else number) for number in range(1, ROWS + 3)))
    assert [fault.fault for fault in check_heads(engine, objects, limit=10).faults] == ["export"]
    rewrite(engine, *(event(number) for number in range(1, ROWS)))
    (fault,) = check_heads(engine, objects, limit=10).faults
    assert (fault.number, "not there" in fault.detail) == (ROWS, True)


def test_an_exported_head_that_was_changed(engine: StoreEngine, objects: ObjectStore, tmp_path: Path) -> None:
    write(engine, 1, 2)
    export(engine, objects)
    (name,) = head_names(objects, limit=9)
    path = next(tmp_path.rglob(name))
    path.chmod(0o600)
    good = path.read_bytes()
    other = orjson.dumps({**orjson.loads(good), "hash": "0" * 64})
    for bad in (b"", b"[]", b"{", good[:-2], other, good.replace(b'"number":2', b'"number":1')):
        path.write_bytes(bad)
        assert [fault.fault for fault in check_heads(engine, objects, limit=9, seal=KEY).faults] == ["export"], bad
    path.write_bytes(good)
    stranger = check_heads(engine, objects, limit=9, seal=MasterKey(b"o" * 32))
    assert (stranger.checked, stranger.sealed, stranger.faults) == (1, 0, [])
