"""The scorer against figures of NAB's own scorer, and its rule on rows one can count by hand."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from load_tests.anomaly.nab_files import Series, read_scores
from load_tests.anomaly.nab_scorer import PROFILES, SILENT, label, optimal, result_at, row_weights
from tests.support.data import data_set

STANDARD, LOW_FP, LOW_FN = PROFILES


def series(rows: int, *windows: tuple[int, int]) -> Series:
    return Series(name="a/b.csv", stamps_s=np.arange(rows) * 300.0, values=np.zeros(rows), windows=windows)


def alarms_at(rows: int, *alarmed: int) -> np.ndarray:
    scores = np.zeros(rows)
    scores[list(alarmed)] = 1.0
    return scores


@pytest.fixture(scope="module")
def golden() -> dict[str, Any]:
    return json.loads(data_set("nab_dev/golden.json").read_text())


@pytest.mark.parametrize("detector", ["windowedGaussian", "skyline"])
def test_what_nabs_own_scorer_found(development: tuple[Series, ...], golden: dict[str, Any], detector: str) -> None:
    folder = data_set("nab_dev/golden") / detector
    scores = [read_scores(folder / f"{one.name}.gz") for one in development]
    assert (len(development), sum(len(one.values) for one in development)) == (golden["series"], golden["rows"])
    for profile in PROFILES:
        labelled, expected = label(development, profile), golden["detectors"][detector][profile.name]
        best = optimal(labelled, scores)
        assert best.threshold == expected["optimal"]["threshold"]
        for row in (expected["optimal"], *expected["fixed"]):
            got = result_at(labelled, scores, row["threshold"])
            assert got.score == pytest.approx(row["normalised"], abs=1e-4)
            assert got.raw == pytest.approx(row["raw"], abs=1e-4)
            assert got.windows_found == row["windows_found"]
            assert got.rows_in_windows_alarmed == row["rows_in_windows_alarmed"]
            assert got.rows_in_windows - got.rows_in_windows_alarmed == row["rows_in_windows_quiet"]
            assert got.rows_outside_alarmed == row["rows_outside_alarmed"]
            assert got.rows_outside - got.rows_outside_alarmed == row["rows_outside_quiet"]
        alone = expected["per_series_raw_at_first_fixed"]
        for one, score in zip(labelled, scores, strict=True):
            raw = result_at([one], [score], expected["fixed"][0]["threshold"]).raw
            assert raw == pytest.approx(alone[one.series.name], abs=1e-4)


def test_the_weights_of_rows_around_windows(development: tuple[Series, ...], golden: dict[str, Any]) -> None:
    weights = {(one.series.name, one.profile.name): one for profile in PROFILES for one in label(development, profile)}
    assert len(golden["row_weights"]) > 100
    for row in golden["row_weights"]:
        one = weights[row["series"], row["profile"]]
        assert one.weights[row["row"]] == pytest.approx(row["weight"], abs=1e-6)
        assert (one.window[row["row"]] >= 0) == row["in_window"]


def test_the_earliest_alarm_of_a_window_counts_and_a_false_row_costs_each_time() -> None:
    labelled = label([series(1000, (500, 599))], STANDARD)
    first = result_at(labelled, [alarms_at(1000, 500, 590)], 0.5)
    assert first.score == pytest.approx(100.0)
    assert (first.windows_found, first.rows_in_windows_alarmed, first.rows_outside_alarmed) == (1, 2, 0)
    assert result_at(labelled, [alarms_at(1000)], 0.5).score == 0.0
    assert result_at(labelled, [alarms_at(1000, 200, 201, 500)], 0.5).raw == pytest.approx(1.0 - 2 * 0.11)
    assert result_at(label([series(1000, (500, 599))], LOW_FN), [alarms_at(1000)], 0.5).raw == -2.0


def test_rows_in_probation_neither_earn_nor_cost() -> None:
    labelled = label([series(1000, (100, 199))], LOW_FP)
    assert result_at(labelled, [alarms_at(1000, 3, 120)], 0.5).raw == -1.0
    assert result_at(labelled, [alarms_at(1000, 150)], 0.5).raw > 0.0
    assert result_at(labelled, [alarms_at(1000)], 0.5).rows_in_windows == 50
    assert series(10_000).probation == 750


def test_just_after_a_window_costs_less_than_long_after() -> None:
    weights = row_weights(1000, [(100, 200)], STANDARD)
    assert weights[99] == -0.11
    assert 0.0 > weights[201] > weights[250] > weights[500] >= -0.11
    assert weights[999] == -0.11
    assert np.isfinite(row_weights(50, [(10, 10)], STANDARD)).all()  # a window of one row has no width after it


def test_rows_of_one_score_are_never_split() -> None:
    scores = alarms_at(1000)
    scores[[300, 520]] = 0.7  # a false row and a hit: together still worth it
    scores[[310, 311, 312, 313, 314, 315, 316, 317, 318, 319, 320]] = 0.2  # not worth it
    labelled = label([series(1000, (500, 599))], STANDARD)
    assert optimal(labelled, [scores]).threshold == 0.7
    scores[:] = 0.0
    assert optimal(labelled, [scores]).threshold == SILENT
    assert optimal(label([series(1000)], STANDARD), [scores]).score == 0.0  # nothing to find
