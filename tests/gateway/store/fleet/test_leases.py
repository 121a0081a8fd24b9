"""Rows of leases: of two who want one unit one gets it, on both databases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gateway.domain.fleet.node_lease import Step, Unit, UnitLease
from gateway.store.engine import StoreEngine
from gateway.store.fleet.leases import read_leases, write_leases

FIRST = UnitLease(unit=Unit("all", "map"), robot="r1", lease_id="a.1", epoch=1, renewals=1, keeper="a", since_ns=5)


def step(before: UnitLease | None, after: UnitLease) -> Step:
    return Step(before, after, boot_ns=1, heard_s=0.0, until_s=5.0)


def write(engine: StoreEngine, *steps: Step) -> list[UnitLease]:
    with engine.transaction(write=True):
        return write_leases(engine, steps)


def test_a_row_is_what_was_written(engine: StoreEngine) -> None:
    other = replace(FIRST, unit=Unit("robot/r1", "map"))
    assert write(engine, step(None, other), step(None, FIRST)) == [FIRST, other]
    moved = replace(FIRST, robot="r2", lease_id="a.2", epoch=2, renewals=2, since_ns=9)
    assert write(engine, step(FIRST, moved)) == [moved, other]
    with engine.transaction(write=False):
        assert read_leases(engine) == [moved, other]


def test_of_two_who_want_it_one_gets_it(connect: Callable[[], StoreEngine]) -> None:
    here, there = connect(), connect()
    theirs = replace(FIRST, robot="r2", lease_id="b.1", keeper="b")
    assert write(here, step(None, FIRST)) == [FIRST]
    assert write(there, step(None, theirs)) == [FIRST]
    renewed = replace(FIRST, renewals=2)
    assert write(here, step(FIRST, renewed)) == [renewed]
    moved = replace(FIRST, robot="r2", lease_id="b.2", epoch=2, renewals=2, keeper="b")
    assert write(there, step(FIRST, moved)) == [renewed]  # planned before it was renewed
    moved = replace(moved, renewals=3)
    assert write(there, step(renewed, moved)) == [moved]
    assert write(here, step(renewed, replace(renewed, renewals=3))) == [moved]
