"""Rows become seconds by their stamps, however they are cut into calls."""

from __future__ import annotations

import numpy as np

from gateway.alerting.anomaly.detectors.cells import LATE_ROWS, SECONDS_AT_ONCE, Cells, Second


def cells_of(slots: int, **options: int) -> Cells:
    cells = Cells(**options)
    cells.slots.grow(slots)
    cells.robots.grow(1)
    cells.slots["robot"][:] = 0
    return cells


def add(cells: Cells, rows: list[tuple[int, float, float]]) -> None:
    slots, stamps, values = zip(*rows, strict=True)
    cells.add(np.array(slots), np.array(stamps, np.float64), np.array(values, np.float64))


def said(seconds: list[Second]) -> list[tuple[float, list[int], list[float]]]:
    return [(second.at_s, second.slots.tolist(), second.mean.tolist()) for second in seconds]


def test_a_second_is_closed_by_a_later_one_of_the_same_robot() -> None:
    cells = cells_of(2)
    add(cells, [(0, 10.1, 1.0), (0, 10.6, 3.0), (1, 10.2, 7.0)])
    assert list(cells.seconds()) == []
    add(cells, [(0, 11.0, 9.0)])
    (second,) = cells.seconds()
    assert (second.at_s, second.slots.tolist()) == (10.0, [0, 1])
    assert second.mean.tolist() == [2.0, 7.0]
    assert (second.low[0], second.high[0], second.last[0], second.spread[0]) == (1.0, 3.0, 3.0, 1.0)


def test_how_rows_are_cut_into_calls_changes_nothing() -> None:
    rng = np.random.default_rng(3)
    rows = [(int(n % 5), 100.0 + n * 0.07, float(rng.normal())) for n in range(2000)]
    whole, parts, found = cells_of(5), cells_of(5), []
    add(whole, rows)
    for start in range(0, len(rows), 37):
        add(parts, rows[start : start + 37])
        found += said(list(parts.seconds()))
    assert found == said(list(whole.seconds()))


def test_what_is_no_number_is_ignored_and_counted() -> None:
    cells = cells_of(1)
    add(cells, [(0, 1.0, np.nan), (0, 1.1, np.inf), (0, np.nan, 1.0), (0, 1e30, 1.0), (0, 1.2, 5.0), (0, 2.0, 5.0)])
    assert said(list(cells.seconds())) == [(1.0, [0], [5.0])]
    assert cells.slots["ignored"][0] == 4


def test_a_late_row_is_left_out_and_a_clock_that_was_set_back_is_followed_after_a_while() -> None:
    cells = cells_of(1)
    add(cells, [(0, 1e6 + n, 1.0) for n in range(3)])
    assert len(list(cells.seconds())) == 2
    add(cells, [(0, 50.0, 2.0)])
    assert list(cells.seconds()) == []
    add(cells, [(0, 60.0 + n, 2.0) for n in range(LATE_ROWS + 5)])
    assert list(cells.seconds()) == []
    add(cells, [(0, 2000.0 + n, 3.0) for n in range(3)])
    assert [second.at_s for second in cells.seconds()] == [2000.0, 2001.0]
    assert cells.slots["all_late"][0] > LATE_ROWS


def test_rows_beyond_the_buffer_are_dropped_oldest_first_and_counted() -> None:
    cells = cells_of(1, pending_rows=10)
    for n in range(4):
        add(cells, [(0, 10.0 * n + k, 1.0) for k in range(4)])
    assert cells.dropped == 8
    assert next(second.at_s for second in cells.seconds()) == 20.0


def test_rows_of_a_forgotten_slot_are_gone() -> None:
    cells = cells_of(2)
    add(cells, [(0, 1.0, 1.0), (1, 1.0, 1.0)])
    cells.forget(np.array([0]))
    add(cells, [(1, 2.0, 1.0)])
    assert said(list(cells.seconds())) == [(1.0, [1], [1.0])]


def test_a_clock_that_stands_still_fills_no_memory() -> None:
    cells = cells_of(1, pending_rows=100)
    for _ in range(10):
        add(cells, [(0, 10.5, 1.0)] * 50)
        assert list(cells.seconds()) == []
    assert len(cells.dump()["slots"]) == 100
    assert cells.dropped == 400
    add(cells, [(0, 11.0, 1.0)])
    (second,) = cells.seconds()
    assert second.count.tolist() == [100.0]


def test_many_seconds_at_once_are_judged_a_piece_at_a_time_and_those_of_others_beside_them() -> None:
    cells = cells_of(2)
    cells.robots.grow(2)
    cells.slots["robot"][1] = 1
    late = 2 * SECONDS_AT_ONCE + 10
    add(cells, [(0, float(at), 1.0) for at in range(late + 1)] + [(1, 9_000.0, 2.0), (1, 9_001.0, 2.0)])
    first = [second.at_s for second in cells.seconds()]
    assert first == [*map(float, range(SECONDS_AT_ONCE)), 9_000.0]
    assert [second.at_s for second in cells.seconds()] == [float(at) for at in range(SECONDS_AT_ONCE, late - 10)]
    assert [second.at_s for second in cells.seconds()] == [float(at) for at in range(late - 10, late)]
    assert list(cells.seconds()) == []


def test_values_whose_squares_are_infinite_are_none() -> None:
    cells = cells_of(1)
    add(cells, [(0, 10.0, 1e308), (0, 10.1, -1e200), (0, 10.2, 3.0), (0, 11.0, 0.0)])
    (second,) = cells.seconds()
    assert (second.mean.tolist(), second.spread.tolist()) == ([3.0], [0.0])
    assert cells.slots["ignored"][0] == 2
