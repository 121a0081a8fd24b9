"""Goals against made figures: ratios, limits, and what was not measured."""

from __future__ import annotations

import pytest

from load_tests.peers.goals import GOALS, judge, ratio
from load_tests.peers.results import Cell, Results


def results_with(**rates: float) -> Results:
    """64 B, one round."""
    results = Results(1, 1.0, [64, 1024], {})
    for key, rate in rates.items():
        results.cell(64, key.replace("_", "-")).add("flood", {"rate": rate})
    return results


def verdict(results: Results, text: str) -> tuple[str, bool | None]:
    """Figure and judgement of the goal that begins so."""
    (found,) = [v for v in judge(results) if v.text.startswith(text)]
    return found.figure, found.reached


def test_ratio_of_nothing_is_nothing() -> None:
    assert ratio(1.0, None) is None
    assert ratio(None, 1.0) is None
    assert ratio(1.0, 0.0) is None
    assert ratio(1.0, 4.0) == 0.25


@pytest.mark.parametrize(("rate", "expected"), [(55.0, ("0.55", True)), (54.9, ("0.55", False))])
def test_a_limit_is_judged_before_rounding(rate: float, expected: tuple[str, bool]) -> None:
    results = results_with(zenoh=100.0, metaros_dedicated=rate)
    assert verdict(results, "dedicated, typed 64 B, of raw") == expected


def test_against_cyclonedds() -> None:
    results = results_with(cyclonedds=10.0, metaros_dedicated=60.0)
    assert verdict(results, "typed 64 B, dedicated, against cyclonedds") == ("6×", True)


def test_threads_are_at_most_so_many() -> None:
    results = results_with()
    results.many["metaros-executor"] = Cell(flood=[{"threads_sub": 7}])
    assert verdict(results, "threads of a node") == ("7", False)


def test_the_worst_round_trip_names_its_size() -> None:
    results = results_with()
    for size, ours in ((64, 90.0), (1024, 150.0)):
        results.cell(size, "zenoh").add("ping", {"p50_us": 100.0})
        results.cell(size, "metaros-executor").add("ping", {"p50_us": ours})
    assert verdict(results, "RTT p50, shared executor, of raw: worst size") == ("1.50 at 1 KiB", False)


def test_a_ratio_has_a_figure_a_round() -> None:
    results = results_with()
    for ours, raw in ((90.0, 100.0), (150.0, 100.0)):
        results.cell(64, "zenoh").add("ping", {"p50_us": raw})
        results.cell(64, "metaros-executor").add("ping", {"p50_us": ours})
    (goal,) = (goal for goal in GOALS if goal.text == "RTT p50, shared executor, 64 B, of raw")
    assert goal.each(results) == [0.9, 1.5]
    assert goal.each(results_with()) == []


def test_without_figures_nothing_is_reached_or_missed() -> None:
    assert [(v.figure, v.reached) for v in judge(results_with())] == [("not measured", None)] * len(GOALS)
