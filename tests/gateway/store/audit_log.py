"""Rows of an audit log, the proof of its chain, and somebody who changes it."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from gateway.store.accounts.audit import AuditEvent, AuditFault, AuditHead, verify_rows
from gateway.store.engine import StoreEngine
from gateway.store.sqlite import SqliteEngine

__all__ = ["COLUMNS", "ROWS", "event", "prove", "tamper"]

TEXTS = [item.name for item in fields(AuditEvent) if item.name not in ("at_ns", "status")]
COLUMNS = ["number", *(item.name for item in fields(AuditEvent)), "hash"]
ROWS = 7


def event(number: int) -> AuditEvent:
    """A row with something of its own in every column."""
    texts: dict[str, Any] = {name: f"{name} {number}" for name in TEXTS}
    return AuditEvent(at_ns=1000 + number, status=200 + number, **texts)


def prove(engine: StoreEngine, *, step: int = 3) -> list[AuditFault]:
    """What does not hold of the whole chain, looked at a few rows at a time."""
    at, more = AuditHead(0, ""), True
    faults: list[AuditFault] = []
    while more:
        at, found, more = verify_rows(engine, at, limit=step)
        faults += found
    return faults


def tamper(engine: StoreEngine, *statements: str) -> None:
    """As somebody does who owns the database: the wall against mistakes is taken away first."""
    with engine.transaction(write=True):
        if isinstance(engine, SqliteEngine):
            engine.execute("DROP TRIGGER IF EXISTS audit_no_update")
            engine.execute("DROP TRIGGER IF EXISTS audit_no_delete")
        else:
            engine.execute("DROP TRIGGER IF EXISTS audit_append_only ON audit")
        for statement in statements:
            assert engine.execute(statement) > 0
