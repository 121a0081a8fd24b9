"""Thresholds with hysteresis and rates of change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gateway.alerting.anomaly.checks import Check, CheckTable
from gateway.alerting.anomaly.detectors.values import Values
from tests.gateway.alerting.anomaly.cellfeed import second

HOT = Check(
    id="hot", title="Hot", kind="threshold", cause="heat", series="**.celsius", high=80.0, hysteresis=5.0, for_s=2.0,
    clear_s=2.0,
)  # fmt: skip
LOW = Check(
    id="low", title="Low", kind="threshold", cause="battery", series="**.charge", low=0.2, hysteresis=0.05, clear_s=0.0
)
SAG = Check(
    id="sag", title="Sag", kind="change", cause="battery", series="**.volts", low=-0.04, window_s=5.0, clear_s=0.0
)


def reported(values: Values, series: list[float], *, start_s: float = 1000.0) -> list[tuple[int, str, bool]]:
    found = []
    for n, value in enumerate(series):
        found += [(n, change.check.id, change.opened) for change in values.feed(second(start_s + n, [value]))]
    return found


def watching(name: str, *rows: Check) -> Values:
    values = Values()
    values.attach(0, name, CheckTable(rows))
    return values


def test_a_threshold_opens_after_for_and_closes_below_its_hysteresis() -> None:
    course = [70.0, 81.0, 82.0, 83.0, 79.0, 78.0, 77.0, 74.0, 74.0, 74.0, 74.0]
    assert reported(watching("cpu.celsius", HOT), course) == [(3, "hot", True), (9, "hot", False)]


def test_a_low_threshold_works_the_other_way_round() -> None:
    assert reported(watching("battery.charge", LOW), [0.3, 0.2, 0.22, 0.26]) == [(1, "low", True), (3, "low", False)]


def test_a_rate_of_change_is_per_second_over_its_window() -> None:
    steady = [25.0 - 0.02 * n for n in range(30)]
    falling = [25.0] * 10 + [25.0 - 0.1 * n for n in range(15)]
    assert reported(watching("pack.volts", SAG), steady) == []
    assert reported(watching("pack.volts", SAG), falling)[0][1:] == ("sag", True)


def test_after_a_gap_of_years_no_change_is_seen() -> None:
    values = watching("pack.volts", SAG)
    reported(values, [25.0] * 20)
    assert reported(values, [5.0] * 3, start_s=3e8) == []
    assert reported(values, [1.0] * 3, start_s=1000.0) == []


def test_what_was_attached_keeps_its_state_across_a_snapshot_and_a_table_without_it_lets_go() -> None:
    values = watching("cpu.celsius", HOT)
    reported(values, [81.0, 81.0])
    parts = values.dump()
    again = Values()
    again.load(parts, CheckTable((HOT,)))
    assert (
        reported(again, [81.0, 81.0], start_s=1002.0)
        == reported(values, [81.0, 81.0], start_s=1002.0)
        == [(0, "hot", True)]
    )
    without = Values()
    without.load(parts, CheckTable((LOW,)))
    assert reported(without, [81.0, 81.0], start_s=1002.0) == []


def test_a_detached_slot_is_looked_at_no_more_and_its_row_is_used_again() -> None:
    values = watching("cpu.celsius", HOT)
    values.detach(0)
    assert reported(values, [99.0] * 5) == []
    values.attach(0, "battery.charge", CheckTable((LOW,)))
    assert len(values.columns) == len(values.holds.columns)
    assert reported(values, [0.1]) == [(0, "low", True)]
    assert np.count_nonzero(values.columns["slot"] >= 0) == 1


def test_a_check_that_changes_leaves_the_state_of_the_others_as_it_was() -> None:
    severe = Check(
        id="severe", title="Severe", kind="threshold", cause="heat", series="**.celsius", high=90.0, clear_s=0.0
    )
    values = watching("cpu.celsius", HOT, severe)
    assert reported(values, [95.0]) == [(0, "severe", True)]
    values.attach(0, "cpu.celsius", CheckTable((replace(HOT, high=85.0), severe)))
    assert reported(values, [60.0], start_s=1001.0) == [(0, "severe", False)]
