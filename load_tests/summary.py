"""One table of what the benchmarks measured: figure, spread, goal, peer; on a terminal, or as Markdown for the docs.

The docs have the runs that are kept in the repository, the terminal the last ones of this clone and what they changed.
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from load_tests.compare import print_changes
from load_tests.figures import FOLDER, KEPT, Run, keep, read_kept, read_runs
from load_tests.goals import GOALS, Goal

__all__ = ["PAGE", "Line", "as_markdown", "lines", "print_summary", "summarise", "written"]

PAGE = Path(__file__).resolve().parents[1] / "docs" / "topics" / "performance.md"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"
_HEAD = ("benchmark", "figure", "measured", "least … most", "goal", "", "peer", "peer's", "× better")
WIDTH = 170  # into a file, or a log
_MARKS = {True: "met", False: "MISSED", None: ""}


@dataclass(frozen=True, slots=True)
class Line:
    """A figure that somebody wants, and what was measured of it; None while nothing was."""

    goal: Goal
    run: Run | None
    values: tuple[float, ...]
    peer: tuple[float, ...]

    @property
    def middle(self) -> float | None:
        """The median of the rounds."""
        return statistics.median(self.values) if self.values else None

    @property
    def met(self) -> bool | None:
        """None where there is no goal, or no figure."""
        return self.goal.met(self.middle) if self.middle is not None else None

    def cells(self) -> tuple[str, ...]:
        """The columns of the table."""
        goal, middle = self.goal, self.middle
        if middle is None:
            return goal.benchmark, goal.figure, "not measured", "", goal.wanted, "", goal.peer, "", ""
        spread = f"{_number(min(self.values))} … {_number(max(self.values))}" if len(self.values) > 1 else ""
        theirs = statistics.median(self.peer) if self.peer else None
        better = (theirs, middle) if goal.less else (middle, theirs)
        ratio = _number(better[0] / better[1]) if theirs and middle and better[0] is not None else ""
        shown = _number(theirs) if theirs is not None else ""
        mark, peer = _MARKS[self.met], self._peer() if theirs is not None else ""
        return goal.benchmark, goal.figure, _with(middle, goal), spread, goal.wanted, mark, peer, shown, ratio

    def _peer(self) -> str:
        """With its version, where that is known."""
        name, _, rest = self.goal.peer.partition(" ")
        version = self.run.peers.get(name, "") if self.run is not None else ""
        return " ".join(part for part in (name, version, rest) if part)


def lines(runs: Mapping[str, Run], names: Collection[str] = ()) -> Iterator[Line]:
    """Every figure of these benchmarks, of all without names."""
    for goal in GOALS:
        if names and goal.benchmark not in names:
            continue
        run = runs.get(goal.run)
        noted = run.figures.get(goal.figure) if run is not None else None
        if noted is None:
            yield Line(goal, run, (), ())
        else:
            yield Line(goal, run, tuple(noted.values), tuple(noted.peer))


def print_summary(
    names: Collection[str] = (), *, folder: Path = FOLDER, kept: Path = KEPT, console: Console | None = None
) -> None:
    """The table of the last runs, under what each of them ran, and what changed since the published ones."""
    console, runs = console or Console(), read_runs(folder)
    if not console.is_terminal:
        console.width = max(console.width, WIDTH)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for place, name in enumerate(_HEAD):
        table.add_column(name, justify="right" if place in (2, 3, 7, 8) else "left", no_wrap=place != 1)
    found, before = list(lines(runs, names)), ""
    for line in found:
        benchmark, *rest = line.cells()
        style = {True: "green", False: "bold red"}.get(line.met, "") if line.met is not None else ""
        cells = [Text(cell, style=style if place == 4 else "") for place, cell in enumerate(rest)]
        table.add_row(benchmark if benchmark != before else "", *cells)
        before = benchmark
    console.print(table)
    fleet = _fleet(folder.parent / "fleet") if not names or "fleet" in names else []
    for text, held in fleet:
        console.print(f"  {_MARKS[held]:7} {text}", highlight=False, style="green" if held else "bold red")
    verdicts = [line.met for line in found] + [held for _, held in fleet]
    met, missed = verdicts.count(True), verdicts.count(False)
    console.print(f"{met} {'goal' if met == 1 else 'goals'} met, {missed} missed.", highlight=False)
    for run in (runs[name] for name in dict.fromkeys(line.goal.run for line in found) if name in runs):
        console.print(f"  {run.benchmark}: {_circumstances(run)}", highlight=False, style="dim")
    print_changes(names, console=console, file=kept, folder=folder)


def as_markdown(runs: Mapping[str, Run]) -> str:
    """The table for the docs: each figure with the command that prints it. What was not measured says so."""
    out = [
        "| figure | measured | least … most | goal | | peer | peer's | × better | command |",
        "|---|---:|---:|---|---|---|---:|---:|---|",
    ]
    for line in lines(runs):
        _, figure, *rest = line.cells()
        measured, spread, wanted, mark, peer, theirs, ratio = rest
        mark = f"**{mark.lower()}**" if line.met is False else mark
        cells = (figure, measured, spread, wanted, mark, peer, theirs, ratio, f"`{line.goal.command}`")
        out.append(f"| {' | '.join(cells)} |")
    out += ["", "| benchmark | when, on what |", "|---|---|"]
    out += [f"| `{run.benchmark}` | {_circumstances(run)} |" for run in runs.values()]
    return "\n".join(out) + "\n"


def written(page: str, runs: Mapping[str, Run]) -> str:
    """The page with the table of these runs between its two marks."""
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n{as_markdown(runs)}{END}{rest.partition(END)[2]}"


def summarise(argv: Sequence[str]) -> int:
    """`--summary`: what was measured last, without measuring."""
    parser = argparse.ArgumentParser(prog="python -m load_tests --summary")
    parser.add_argument("names", nargs="*", help="benchmarks; all without")
    parser.add_argument("--markdown", action="store_true", help="as docs/topics/performance.md has it")
    parser.add_argument("--write", action="store_true", help="keep these runs, and put them there")
    options = parser.parse_args(list(argv))
    if options.write:
        runs = {name: run for name, run in read_runs().items() if not options.names or run.benchmark in options.names}
        PAGE.write_text(written(PAGE.read_text(), keep(runs)))
    elif options.markdown:
        print(as_markdown(read_kept() | read_runs()), end="")
    else:
        print_summary(options.names)
    return 0


def _fleet(folder: Path) -> list[tuple[str, bool]]:
    """The goals of the fleet's own reports, but for samples: what they say, and whether they were met."""
    found = []
    for path in sorted(folder.glob("*.json")):
        if path.stem.endswith("-quick"):
            continue
        record = json.loads(path.read_text())
        for figures in record["rounds"]:
            name = f"{path.stem} {figures.get('name', '')}".strip()
            found += [(f"fleet {name}: {goal['text']}", bool(goal["met"])) for goal in figures.get("goals", ())]
    return found


def _circumstances(run: Run) -> str:
    load = f", load {run.load:.1f} before it" if run.load is not None else ""
    options = f" with `{' '.join(run.options)}`" if run.options else ""
    return f"{run.at} UTC{options}, {run.seconds:.0f} s{load}; {run.machine}"


def _with(value: float, goal: Goal) -> str:
    return f"{_number(value)} {goal.unit}".rstrip()


def _number(value: float) -> str:
    """Three digits that count, all of large ones."""
    if value == int(value) or abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.3g}"
