"""Every peer beside Meta-ROS, between two processes: throughput, round trips, and what they cost.

    python -m load_tests peers [--quick] [--rounds 5] [--seconds 1] [--only metaros,zenoh] [--sizes 64,1048576]
                               [--json FILE] [--svg FILE]
    python -m load_tests peers --markdown FILE.json

docs/reference/benchmarks.md says how to read the table. Rounds are interleaved: every cell once, then all again. Each
figure is the median over the rounds. A peer that fails has its error in its row. The results are kept in
.make/peers/latest.json, from round to round, and where `--json` says.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from load_tests.figures import note
from load_tests.peers.chart import as_svg
from load_tests.peers.goals import GOALS
from load_tests.peers.pair import WARM_UP_S
from load_tests.peers.results import Cell, Results, ResultsFileError, machine
from load_tests.peers.rows import QUICK_SIZES, SIZES, Row, UnknownRow, chosen, pings_of, planned, size_name
from load_tests.peers.tables import as_markdown, print_results
from load_tests.peers.venvs import FOLDER, ROOT, HomeFailed, python_of

__all__ = ["QUICK_S", "estimate_s", "main", "measure"]

MIN_ROUNDS = 5
QUICK_S = 0.2
_PAIR_S = 150  # a pair that takes longer is given up
_TRIES = 2  # a cell that failed so often is left out of the further rounds
_STARTS_S = 1.3  # what a cell takes beside its measured time: four processes that start and connect
_MANY, _MANY_S = 20, 0.2

Step = Callable[[str], None]


def measure(rows: Sequence[Row], sizes: Sequence[int], *, rounds: int, seconds: float, step: Step) -> Results:
    """Everything, round by round; what was measured when the user interrupts is kept."""
    results = Results(rounds, seconds, list(sizes), machine())
    pythons = _pythons(rows, step)
    try:
        for row in rows:
            if not row.smallest:
                step(f"{row.label}, {_MANY} subscriptions")
                job = _job(row, pythons, SIZES[0], _MANY_S, subscriptions=_MANY)
                results.many.setdefault(row.key, Cell()).add("flood", _run({**job, "phase": "flood"}))
        for number in range(rounds):
            for size, row in planned(rows, sizes):
                step(f"round {number + 1}/{rounds}: {row.label}, {size_name(size)}")
                _measure_cell(results.cell(size, row.key), _job(row, pythons, size, seconds))
            results.save(FOLDER / "latest.json")
    except KeyboardInterrupt:
        step("interrupted: this is what was measured so far")
    return results


def _measure_cell(cell: Cell, job: dict[str, Any]) -> None:
    """One more round of a cell, unless it failed too often."""
    for phase in ("flood", "ping"):
        if len(cell.errors) < _TRIES:
            cell.add(phase, _run({**job, "phase": phase}))


def _pythons(rows: Sequence[Row], step: Step) -> dict[str, str | HomeFailed]:
    """The interpreter of each home, or why there is none."""
    found: dict[str, str | HomeFailed] = {}
    for home in dict.fromkeys(row.home for row in rows):
        step(f"environment of {home}")
        try:
            found[home] = python_of(home)
        except HomeFailed as error:
            found[home] = error
    return found


def _job(row: Row, pythons: dict[str, str | HomeFailed], size: int, seconds: float, **more: Any) -> dict[str, Any]:
    """What a pair is told."""
    python = pythons[row.home]
    if isinstance(python, HomeFailed):
        return {"error": str(python)}
    return {
        "python": python,
        "module": row.module,
        "mode": row.mode,
        "brokered": row.brokered,
        "ping_pause_s": row.ping_pause_s,
        "size": size,
        "seconds": seconds,
        "pings": pings_of(size),
        "ping_s": seconds,
        **more,
    }


def _run(job: dict[str, Any]) -> dict[str, Any]:
    """One pair of processes, which cannot outlive this call: their parent's pipes are their life."""
    if "error" in job:
        return {"error": job["error"]}
    command = [sys.executable, "-m", "load_tests.peers.pair", json.dumps(job)]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=_PAIR_S)
        found: dict[str, Any] = json.loads(done.stdout)
    except subprocess.TimeoutExpired:
        return {"error": f"took more than {_PAIR_S} s"}
    except json.JSONDecodeError:
        return {"error": (done.stderr.strip().splitlines() or ["no result"])[-1]}
    return found


def estimate_s(cells: int, rounds: int, seconds: float) -> float:
    """How long such a run takes, roughly."""
    return cells * rounds * (_STARTS_S + min(WARM_UP_S, seconds) + 1.35 * seconds)


def _measure_shown(options: argparse.Namespace, console: Console) -> Results:
    """With a bar on a terminal, with a line a cell elsewhere."""
    rows = chosen(options.only, quick=options.quick)
    cells = len(planned(rows, options.sizes))
    minutes = estimate_s(cells, options.rounds, options.seconds) / 60
    console.print(f"{cells} cells × {options.rounds} rounds, about {max(1, round(minutes))} min", highlight=False)
    total = cells * options.rounds + sum(not row.smallest for row in rows) + len({row.home for row in rows})
    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task, begun = progress.add_task("", total=total), False

        def step(text: str) -> None:
            nonlocal begun
            progress.update(task, description=text, advance=1 if begun else 0)
            begun = True
            if not console.is_terminal:
                print(text, file=sys.stderr, flush=True)

        return measure(rows, options.sizes, rounds=options.rounds, seconds=options.seconds, step=step)


def _parser() -> argparse.ArgumentParser:
    def comma(kind: Callable[[str], Any]) -> Callable[[str], list[Any]]:
        return lambda text: [kind(part.strip()) for part in text.split(",") if part.strip()]

    parser = argparse.ArgumentParser(prog="python -m load_tests peers", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two sizes, short rounds: about three minutes")
    parser.add_argument("--rounds", type=int, default=MIN_ROUNDS, help="interleaved rounds (5)")
    parser.add_argument("--seconds", type=float, help="measured time a round and cell (1; quick 0.2)")
    parser.add_argument("--only", type=comma(str), default=[], help="peers or rows, separated by commas")
    parser.add_argument("--sizes", type=comma(int), help="payload sizes in bytes, separated by commas")
    parser.add_argument("--json", type=Path, help="write the results here")
    parser.add_argument("--svg", type=Path, help="write a chart of the message rates here")
    parser.add_argument("--markdown", type=Path, metavar="FILE.json", help="measure nothing: print results as Markdown")
    return parser


def main(argv: Sequence[str] = ()) -> int:
    """Measure and print; exit code 2 for what cannot be asked."""
    parser, console = _parser(), Console()
    options = parser.parse_args(list(argv))
    options.seconds = options.seconds or (QUICK_S if options.quick else 1.0)
    options.sizes = options.sizes or list(QUICK_SIZES if options.quick else SIZES)
    if options.rounds < 1 or options.seconds < 0.05 or min(options.sizes) < 1 or max(options.sizes) > 15 << 20:
        parser.error("--rounds from 1, --seconds from 0.05, --sizes within 1..15728640")
    try:
        results = Results.load(options.markdown) if options.markdown else _measure_shown(options, console)
    except (UnknownRow, ResultsFileError) as error:
        parser.error(str(error))
    for goal in GOALS if not options.markdown else ():
        if (figure := goal.figure(results)) is not None:
            note(goal.text, goal.each(results) or [figure[0]])
    if options.markdown:
        print(as_markdown(results), end="")
    else:
        print_results(results, console)
    if options.json:
        results.save(options.json)
    if options.svg:
        options.svg.write_text(as_svg(results))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
