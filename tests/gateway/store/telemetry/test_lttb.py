"""LTTB: what it keeps, against the algorithm as its author writes it, in plain loops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.store.telemetry.lttb import extremes, lttb


def by_the_registry(x: list[float], y: list[float], points: int) -> list[int]:
    """Steinarsson's loops, with buckets cut as ours are."""
    count = len(x)
    cuts = [1 + (count - 2) * number // (points - 2) for number in range(points - 1)]
    kept = [0]
    for bucket in range(points - 2):
        later = range(cuts[bucket + 1], cuts[bucket + 2]) if bucket < points - 3 else [count - 1]
        mean_x, mean_y = sum(x[i] for i in later) / len(later), sum(y[i] for i in later) / len(later)
        a = kept[-1]
        areas = [
            abs((x[a] - mean_x) * (y[i] - y[a]) - (x[a] - x[i]) * (mean_y - y[a]))
            for i in range(cuts[bucket], cuts[bucket + 1])
        ]
        kept.append(cuts[bucket] + areas.index(max(areas)))
    return [*kept, count - 1]


@given(st.lists(st.integers(-1000, 1000), min_size=4, max_size=120), st.integers(3, 40))
@settings(max_examples=50)
def test_it_keeps_what_its_author_keeps(values: list[int], points: int) -> None:
    x, y = np.arange(len(values), dtype=np.float64), np.array(values, np.float64)
    kept = lttb(x, y, points).tolist()
    if len(values) <= points:
        assert kept == list(range(len(values)))
        return
    registry = by_the_registry(x.tolist(), y.tolist(), points)
    assert (len(kept), kept[0], kept[-1]) == (points, 0, len(values) - 1)
    assert kept == sorted(set(kept))
    assert kept == registry


def test_a_single_peak_is_never_lost() -> None:
    x, y = np.arange(100_000, dtype=np.float64), np.zeros(100_000)
    y[77_777] = 1.0
    assert 77_777 in lttb(x, y, 50).tolist()
    y[77_777] = np.inf
    assert 77_777 in lttb(x, y, 50).tolist()


@pytest.mark.parametrize("points", [1, 2])
def test_fewer_than_three_points(points: int) -> None:
    assert lttb(np.arange(9.0), np.arange(9.0), points).tolist() == [0, 8][:points]


@settings(max_examples=50)
@given(st.lists(st.lists(st.integers(-5, 5), min_size=1, max_size=9), min_size=1, max_size=9))
def test_extremes_are_the_first_smallest_and_largest_of_each_span(spans: list[list[int]]) -> None:
    starts = np.cumsum([0, *map(len, spans)])[:-1]
    values = np.array([value for span in spans for value in span], np.float64)
    expected = {0, len(values) - 1}
    for start, span in zip(starts.tolist(), spans, strict=True):
        expected |= {start + span.index(min(span)), start + span.index(max(span))}
    assert extremes(values, starts).tolist() == sorted(expected)
