"""Leases of migratable nodes in the database. Every function runs inside a transaction of the caller's."""

from __future__ import annotations

from collections.abc import Sequence

from gateway.domain.fleet.node_lease import Step, Unit, UnitLease
from gateway.store.engine import StoreEngine

__all__ = ["read_leases", "write_leases"]

_COLUMNS = "scope, node, robot, lease, epoch, renewals, keeper, since_ns"


def read_leases(engine: StoreEngine) -> list[UnitLease]:
    """Every unit's last lease, over or not."""
    return [
        UnitLease(
            unit=Unit(row[0], row[1]),
            robot=row[2],
            lease_id=row[3],
            epoch=row[4],
            renewals=row[5],
            keeper=row[6],
            since_ns=row[7],
        )
        for row in engine.fetch(f"SELECT {_COLUMNS} FROM node_leases ORDER BY scope, node")
    ]


def write_leases(engine: StoreEngine, steps: Sequence[Step]) -> list[UnitLease]:
    """Take each step whose row is still what it was planned for; all rows afterwards, which say what was taken.

    Give steps in the order of their units, so that gateways do not wait for each other in a circle.
    """
    first = [step.after for step in steps if step.before is None]
    if first:
        engine.many(
            f"INSERT INTO node_leases ({_COLUMNS}) VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
            [(one.unit.scope, one.unit.node, *_values(one)) for one in first],
        )
    later = [(step.before, step.after) for step in steps if step.before is not None]
    if later:
        engine.many(
            "UPDATE node_leases SET robot = ?, lease = ?, epoch = ?, renewals = ?, keeper = ?, since_ns = ?"
            " WHERE scope = ? AND node = ? AND epoch = ? AND renewals = ?",
            [
                (*_values(after), after.unit.scope, after.unit.node, before.epoch, before.renewals)
                for before, after in later
            ],
        )
    return read_leases(engine)


def _values(held: UnitLease) -> tuple[str | int, ...]:
    return held.robot, held.lease_id, held.epoch, held.renewals, held.keeper, held.since_ns
