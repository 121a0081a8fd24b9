"""The rows since a moment: merged or not, with the watermarks of the same moment."""

from __future__ import annotations

import pytest

from gateway.store.alerting.watch_rows import RecentRows, read_recent
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.telemetry.merge import merge_step
from tests.gateway.store.samples import BATTERY, CPU, EPOCH, write

S = 10**9


def put(engine: StoreEngine, first: int, last: int) -> None:
    """Numbers from `first` to `last`: of each second one row a series."""
    committer = Committer(engine)
    for number in range(first, last + 1):
        rows = ((CPU, number * S, float(number)), (BATTERY, number * S + 5, -float(number)))
        committer.commit([write(2 * number, *rows)], now_ns=number * S)


def reported(found: RecentRows) -> list[tuple[str, int, float]]:
    names = [found.series[at][0] for at in found.index.tolist()]
    return list(zip(names, found.stamps.tolist(), found.values.tolist(), strict=True))


@pytest.mark.parametrize("merged", [0, 3, 1000])
def test_rows_since_a_moment(engine: StoreEngine, merged: int) -> None:
    put(engine, 1, 8)
    if merged:
        merge_step(engine, max_batches=merged)
    found = read_recent(engine, "r1", start_ns=5 * S, end_ns=7 * S, most=100)
    assert reported(found) == [
        ("host.cpu", 5 * S, 5.0),
        ("battery", 5 * S + 5, -5.0),
        ("host.cpu", 6 * S, 6.0),
        ("battery", 6 * S + 5, -6.0),
        ("host.cpu", 7 * S, 7.0),
    ]
    assert (found.marks, found.left_out) == ({(0, EPOCH): 16}, 0)
    few = read_recent(engine, "r1", start_ns=0, end_ns=100 * S, most=3)
    assert [row[2] for row in reported(few)] == [-7.0, 8.0, -8.0]
    assert few.left_out == 13
    assert len(read_recent(engine, "nobody", start_ns=0, end_ns=100 * S, most=3)) == 0


def test_what_is_damaged_is_left_out(engine: StoreEngine) -> None:
    put(engine, 1, 4)
    merge_step(engine, max_batches=100)
    put(engine, 5, 6)
    with engine.transaction(write=True):
        broken = "UPDATE metric_chunks SET vals = ? WHERE series = (SELECT series FROM series WHERE name = 'battery')"
        engine.execute(broken, b"\x07")
    found = read_recent(engine, "r1", start_ns=0, end_ns=100 * S, most=100)
    assert [row[2] for row in reported(found)] == [1.0, 2.0, 3.0, 4.0, 5.0, -5.0, 6.0, -6.0]
