"""Losses without a time are placed between what is stored beside them, on both databases."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gateway.domain.sample import Gap
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.telemetry.undated_gaps import undated_gaps
from gateway.store.writes import StreamWrite
from tests.gateway.store.samples import gap_write, run_write

STORED_NS = 9_000


def lost(from_seq: int, to_seq: int, *, stream_id: int = 7) -> StreamWrite:
    """A loss that says nothing about when."""
    gap = Gap(from_seq, to_seq, "disk_corrupt", 0, 0)
    return replace(gap_write(from_seq, to_seq, stream_id=stream_id), gap=gap)


def spans(engine: StoreEngine, start_ns: int = 0, end_ns: int = 1 << 60) -> list[tuple[int, int, int, str]]:
    found = undated_gaps(engine, "r1", start_ns=start_ns, end_ns=end_ns, limit=100)
    return [(item.gap.count, item.gap.from_ns, item.gap.to_ns, item.topic) for item in found]


@pytest.mark.parametrize(
    ("range_ns", "seen"), [((0, 1 << 60), True), ((1005, 1006), True), ((0, 1004), False), ((2010, 3000), False)]
)
def test_a_loss_lies_between_its_neighbours(engine: StoreEngine, range_ns: tuple[int, int], seen: bool) -> None:
    writes = [run_write(1, [b"x"] * 5), lost(6, 9), run_write(10, [b"x"] * 5, stamp_ns=1990)]
    Committer(engine).commit(writes, now_ns=STORED_NS)
    assert spans(engine, *range_ns) == ([(4, 1005, 2000, "/events")] if seen else [])


def test_a_loss_without_neighbours(engine: StoreEngine) -> None:
    first = [lost(1, 4), run_write(5, [b"x"])]
    last = [run_write(1, [b"x"], stream_id=8), lost(2, 3, stream_id=8)]
    Committer(engine).commit([*first, *last, lost(1, 1, stream_id=9)], now_ns=STORED_NS)
    assert sorted(spans(engine)) == [
        (1, STORED_NS, STORED_NS, ""),
        (2, 1001, STORED_NS, "/events"),
        (4, 1005, 1005, "/events"),
    ]


def test_dated_losses_are_not_among_them(engine: StoreEngine) -> None:
    Committer(engine).commit([gap_write(1, 4)], now_ns=STORED_NS)
    assert spans(engine) == []
