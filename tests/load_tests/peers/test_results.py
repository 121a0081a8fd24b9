"""Medians of rounds, and the file they are kept in."""

from __future__ import annotations

from pathlib import Path

import pytest

from load_tests.peers.results import Cell, Results, ResultsFileError, machine


def test_figures_are_medians_over_the_rounds_that_have_them() -> None:
    cell = Cell()
    for rate in (10.0, 30.0, 20.0):
        cell.add("flood", {"rate": rate, "sent_rate": 40.0, "wire": None})
    cell.add("ping", {"p50_us": 5.0})
    assert cell.median("rate") == 20.0
    assert cell.median("p50_us") == 5.0
    assert cell.median("wire") is None
    assert cell.arrived == 0.5


def test_an_error_is_no_figure() -> None:
    cell = Cell()
    cell.add("ping", {"error": "no answer"})
    assert cell.errors == ["no answer"]
    assert cell.median("p50_us") is None
    assert cell.arrived is None


def test_results_survive_the_file(tmp_path: Path) -> None:
    results = Results(5, 1.0, [64], machine())
    results.cell(64, "zenoh").add("flood", {"rate": 1.5, "others_cores": 0.5})
    results.cell(64, "zenoh").add("ping", {"p50_us": 2.5, "others_cores": 0.1})
    results.many["zenoh"] = Cell(flood=[{"threads_sub": 24}])
    results.save(tmp_path / "deep" / "results.json")
    loaded = Results.load(tmp_path / "deep" / "results.json")
    assert loaded == results
    assert loaded.disturbed() == (1, 2)
    assert (loaded.rounds, loaded.done) == (5, 1)
    assert loaded.median(64, "nobody", "rate") is None


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 9}', '{"format": 1, "rounds": 5}'])
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(ResultsFileError, match=r"other\.json"):
        Results.load(path)
