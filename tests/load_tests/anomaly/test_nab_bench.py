"""The detectors on the development series: the goals at the one fixed threshold, fitted by fold, and the table."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from gateway.alerting.anomaly.parameters import FIXED, THRESHOLD
from load_tests.anomaly import nab_bench
from load_tests.anomaly.__main__ import main
from load_tests.anomaly.families import CHECKING, TUNING, make_series
from load_tests.anomaly.nab_files import FilesError, Series, read_folder
from load_tests.anomaly.nab_scorer import PROFILES, label, result_at
from load_tests.anomaly.nab_tune import TUNED, candidates, cross_validate, score_all
from load_tests.anomaly.unseen_families import UNSEEN

GOALS = {"standard": 66.0, "reward_low_FP_rate": 55.0, "reward_low_FN_rate": 72.0}


def written(folder: Path, rows: int, *, odd: int = -1) -> Path:
    """A file of NAB's kind: 5-minute rows of a small wave, one of them far off."""
    folder.mkdir(parents=True, exist_ok=True)
    times = np.datetime64("2026-01-01T00:00:00") + np.arange(rows) * np.timedelta64(300, "s")
    lines = [f"{str(time).replace('T', ' ')},{99.0 if at == odd else at % 12}" for at, time in enumerate(times)]
    path = folder / "wave.csv"
    path.write_text("timestamp,value\n" + "\n".join(lines) + "\n")
    return path


@pytest.mark.integration
def test_one_parameter_set_and_one_threshold_reach_the_goals(development: tuple[Series, ...]) -> None:
    scores = score_all(development, FIXED)
    assert all(((score >= 0.0) & (score <= 1.0)).all() for score in scores)
    for profile in PROFILES:
        result = result_at(label(development, profile), scores, THRESHOLD)
        assert result.score >= GOALS[profile.name], profile.name
        assert result.false_per_thousand < 1.0


@pytest.mark.integration
def test_parameters_of_other_categories_are_good_for_these(development: tuple[Series, ...]) -> None:
    seen: list[int] = []
    configs = list(candidates(2))  # `python -m load_tests.anomaly nab` tries two dozen
    results, folds = cross_validate(development, configs, progress=lambda done, total: seen.append(done))
    assert seen == list(range(3))
    assert results["standard"].score >= 62.0
    assert results["standard"].windows == 71
    assert [fold.category for fold in folds] == sorted({one.category for one in development})
    assert {fold.config for fold in folds} <= set(configs)


def test_candidates_differ_in_what_was_tuned_and_are_the_same_each_time() -> None:
    drawn = list(candidates())
    assert drawn == list(candidates())
    assert len(set(drawn)) == len(drawn)
    for name, options in TUNED.items():
        assert {getattr(config, name) for config in drawn} == set(options)


def test_a_folder_without_labels_says_how_often_it_would_alert(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path, 600, odd=500)
    assert main([str(tmp_path)]) == 0
    reported = capsys.readouterr().out
    assert "1 series, 600 rows" in reported
    assert "wave.csv" in reported
    assert "Profile" not in reported
    series, _ = read_folder(tmp_path)
    (scores,) = score_all(series, FIXED)
    assert np.flatnonzero(scores >= THRESHOLD).tolist() == [500]


def test_a_labelled_folder_of_ones_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(tmp_path / "data" / "mine", 600, odd=500)
    windows = '{"mine/wave.csv": [["2026-01-02 16:00:00.000000", "2026-01-02 18:00:00.000000"]]}'
    (tmp_path / "labels").mkdir()
    (tmp_path / "labels" / "combined_windows.json").write_text(windows)
    assert main(["nab", str(tmp_path)]) == 0
    reported = capsys.readouterr().out
    assert "1 of 1" in reported
    assert "mine" in reported
    assert "ARTime" not in reported  # those figures are of other files


def test_a_folder_that_has_nothing_or_something_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "nowhere")]) == 2
    assert "no CSV files" in capsys.readouterr().err
    (tmp_path / "bad.csv").write_text("timestamp,value\n2026-01-01 00:00:00,1\nnever,2\n")
    with pytest.raises(FilesError, match=r"bad.csv, line 3: .*never,2"):
        read_folder(tmp_path)


def test_what_there_is_to_measure(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    assert main([]) == 2
    assert capsys.readouterr().out.count("python -m load_tests.anomaly") == 2 * 4


@pytest.mark.integration
def test_the_table_of_folds(development: tuple[Series, ...], capsys: pytest.CaptureFixture[str]) -> None:
    few = [one for one in development if one.category == "realAdExchange" or "speed_7578" in one.name]
    results, folds = cross_validate(few, list(candidates(2)), progress=lambda done, total: None)
    nab_bench._show_folds(results, folds)
    reported = capsys.readouterr().out
    assert "Leaving a category out" in reported
    assert "window_samples" in reported


def test_made_up_series_are_like_nabs_and_the_same_each_time() -> None:
    families = (*TUNING, *CHECKING, *UNSEEN)
    made, again = (make_series(families, seed=3, each=6) for _ in range(2))
    assert len({family.usual for family in families}) == len(families)
    assert len({one.name for one in made}) == len(made) == 6 * len(families)
    for one, same in zip(made, again, strict=True):
        assert (one.values == same.values).all()
        assert 1000 <= len(one.values) <= 22_000
        assert np.isfinite(one.values).all()
        assert (np.diff(one.stamps_s) > 0.0).all()
        inside = sum(last - first + 1 for first, last in one.windows)
        assert not one.windows or 0.08 < inside / len(one.values) < 0.12
        assert all(first >= one.probation for first, _ in one.windows)
        assert all(before[1] < after[0] for before, after in itertools.pairwise(one.windows))
    assert sum(not one.windows for one in made) == len(families)
