"""What became of a figure: told where it changed by more than its rounds differ, and can be compared at all."""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.console import Console

from load_tests.__main__ import runs_of
from load_tests.compare import Verdict, changes, print_changes
from load_tests.figures import Noted, Run, gathered, keep, note, read_kept, read_runs
from load_tests.goals import Goal

PAGE_P99, CALL_P50, WARM_P50 = "p99 of a page of 100", "call p50", "p50 of a warm call"


def run_of(benchmark: str, figures: dict[str, Noted], machine: str = "here") -> dict[str, Run]:
    """A run of which only these matter."""
    run = Run(benchmark=benchmark, options=[], at="", machine=machine, load=None, figures=figures)
    return {run.name: run}


@pytest.mark.parametrize(
    ("benchmark", "figure", "before", "now", "verdict"),
    [
        ("functions", WARM_P50, [0.3, 0.31, 0.32], [0.34, 0.35, 0.36], Verdict.WORSE),
        ("functions", WARM_P50, [0.3, 0.31, 0.32], [0.31, 0.32, 0.33], Verdict.SAME),
        ("functions", WARM_P50, [0.3, 0.31, 0.32], [0.2, 0.35, 0.5], Verdict.SAME),  # by less than its own rounds
        ("functions", WARM_P50, [0.34, 0.35, 0.36], [0.3, 0.31, 0.32], Verdict.BETTER),
        ("functions", "one worker", [5000, 5100, 5200], [4000, 4100, 4200], Verdict.WORSE),  # more is better
        ("executor", "critical timer p99, fair executor", [0.40], [0.43], Verdict.SAME),  # one round: a tenth
        ("executor", "critical timer p99, fair executor", [0.40], [0.45], Verdict.WORSE),
    ],
)
def test_what_changed_is_what_changed_by_more_than_the_rounds_differ(
    benchmark: str, figure: str, before: list[float], now: list[float], verdict: Verdict
) -> None:
    (found,) = changes(run_of(benchmark, {figure: Noted(before, [])}), run_of(benchmark, {figure: Noted(now, [])}))
    assert (found.goal.figure, found.verdict) == (figure, verdict)


def test_another_machine_is_compared_by_ratios_only() -> None:
    before = run_of("service", {CALL_P50: Noted([400, 410], [320, 330]), "call p50, of raw": Noted([1.2, 1.3], [])})
    now = run_of(
        "service", {CALL_P50: Noted([800, 820], [640, 660]), "call p50, of raw": Noted([1.6, 1.7], [])}, "there"
    )
    found = {change.goal.figure: change for change in changes(before, now)}
    assert found[CALL_P50].verdict is Verdict.SAME  # all of it is half as fast there, the peer as well
    assert found["call p50, of raw"].verdict is Verdict.WORSE
    page = Noted([70.0], [])
    (alone,) = changes(run_of("rest", {PAGE_P99: page}), run_of("rest", {PAGE_P99: page}, "there"))
    assert alone.verdict is Verdict.NOT_COMPARED
    assert changes(before, now, ["rest"]) == []


def test_what_became_slower_is_named(tmp_path: Path) -> None:
    kept = tmp_path / "kept.json"
    for values in ([20.0, 21.0], [70.0123456789, 71.0]):
        with gathered("rest", [], folder=tmp_path / "bench"):
            note(PAGE_P99, values)
        if not kept.exists():
            keep(runs_in(tmp_path), kept)
    console = Console(width=200, record=True)
    print_changes(console=console, file=kept, folder=tmp_path / "bench")
    text = console.export_text()
    assert "slower: rest: p99 of a page of 100: 70.51 ms, was 20.5; the rounds differ by 1" in text
    assert "Beside the published runs: 1 slower." in text
    keep(runs_in(tmp_path), kept)
    assert read_kept(kept)["rest"].figures[PAGE_P99].values == [70.0123, 71.0]  # as precise as a benchmark is


def runs_in(folder: Path) -> dict[str, Run]:
    """The runs of a clone."""

    return read_runs(folder / "bench")


def test_a_run_with_options_that_figures_ask_for_is_one_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = Goal(benchmark="fanout", figure="cost", unit="%", options="--json")
    monkeypatch.setattr("load_tests.goals.GOALS", (asked, Goal(benchmark="fanout", figure="rate", unit="/s")))

    def name(*options: str) -> str:
        return Run(benchmark="fanout", options=list(options), at="", machine="", load=None).name

    assert name("--json", "--rounds", "3") == asked.run == "fanout --json"
    assert name("--rounds", "3") == "fanout"
    assert runs_of("fanout") == [["--json"], []]
