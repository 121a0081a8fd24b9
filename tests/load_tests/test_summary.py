"""The summary of the benchmarks: figures kept, goals judged, and a page that names only commands that there are."""

from __future__ import annotations

import argparse
import importlib
import re
from pathlib import Path

import pytest
from rich.console import Console

from load_tests.__main__ import BENCHMARKS, main, module_of
from load_tests.figures import gathered, note, read_runs
from load_tests.goals import GOALS
from load_tests.summary import PAGE, as_markdown, lines, print_summary, written

COMMAND = re.compile(r"`(?:\.venv/bin/)?python -m load_tests ([^`]+)`")


def run_of(folder: Path, name: str, **figures: list[float]) -> None:
    """A run of which only the figures matter."""
    with gathered(name, ["--rounds", "2"], folder=folder) as run:
        for figure, values in figures.items():
            note(figure.replace("_", " "), values)
        run.code = 1


def test_what_a_benchmark_noted_is_there_again(tmp_path: Path) -> None:
    note("nobody gathers", [1.0])
    run_of(tmp_path, "rules", one_event=[30.0, 40.0, 50.0])
    run = read_runs(tmp_path)["rules"]
    assert (run.options, run.code, list(run.figures)) == (["--rounds", "2"], 1, ["one event"])
    assert run.figures["one event"].values == [30.0, 40.0, 50.0]


def test_a_run_that_breaks_off_keeps_the_one_before(tmp_path: Path) -> None:
    run_of(tmp_path, "rules", one_event=[1.0])
    with pytest.raises(KeyboardInterrupt):
        _broken_off(tmp_path)
    assert read_runs(tmp_path)["rules"].figures["one event"].values == [1.0]


def _broken_off(folder: Path) -> None:
    with gathered("rules", [], folder=folder):
        note("one event", [2.0])
        raise KeyboardInterrupt


def test_goals_are_met_or_missed_by_the_median(tmp_path: Path) -> None:
    with gathered("rest", [], folder=tmp_path):
        note("p99 of a page of 100", [20.0, 51.0, 70.0])
    with gathered("rules", [], folder=tmp_path):
        note("one event, 1,000 rules", [36.0, 40.0], peer=[38_000.0, 38_000.0])
    (rest,) = lines(read_runs(tmp_path), ["rest"])
    assert (rest.middle, rest.met) == (51.0, False)
    rules, unjudged = lines(read_runs(tmp_path), ["rules"])
    assert (rules.met, rules.cells()[-2:]) == (True, ("38,000", "1,000"))
    assert (unjudged.met, unjudged.cells()[2]) == (None, "not measured")
    console = Console(width=200, record=True)
    print_summary(["rest", "rules"], folder=tmp_path, console=console)
    text = console.export_text()
    assert "MISSED" in text
    assert "1 goal met, 1 missed." in text
    assert "| **missed** |" in as_markdown(read_runs(tmp_path))


def test_a_page_keeps_all_but_its_table(tmp_path: Path) -> None:
    run_of(tmp_path, "rules", one_event=[1.0])
    page = PAGE.read_text()
    once = written(page, read_runs(tmp_path))
    assert written(once, read_runs(tmp_path)) == once
    assert once.partition("<!-- figures")[0] == page.partition("<!-- figures")[0]
    assert once.rpartition("figures: end -->")[2] == page.rpartition("figures: end -->")[2]


def test_goals_are_of_figures_that_some_benchmark_notes() -> None:
    assert {goal.benchmark for goal in GOALS} <= set(BENCHMARKS)
    assert len({(goal.benchmark, goal.figure) for goal in GOALS}) == len(GOALS)


@pytest.mark.parametrize(
    "command", sorted({*COMMAND.findall(PAGE.read_text()), *(g.command.split(" ", 3)[3] for g in GOALS)})
)
def test_every_command_of_the_page_is_understood(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The benchmark is there and knows the options: what follows their parsing is cut off."""
    name, *options = command.split()
    if name == "--summary":
        assert options in ([], ["--markdown"], ["--write"])
        return
    assert name in BENCHMARKS, command

    class Parsed(Exception):
        pass

    parse = argparse.ArgumentParser.parse_args

    def parsed(self: argparse.ArgumentParser, *args: object, **more: object) -> object:
        parse(self, *args, **more)  # type: ignore[call-overload]
        raise Parsed

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parsed)
    with pytest.raises(Parsed):
        importlib.import_module(module_of(name)).main(options)


def test_the_summary_runs_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--summary", "rest"]) == 0
    assert "p99 of a page of 100" in capsys.readouterr().out
