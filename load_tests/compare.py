"""Which figures of the last runs became worse than the published ones, by more than the rounds differ.

A figure that was measured beside a peer is compared as the ratio to it, which lasts from machine to machine; so are
figures that are ratios or counts themselves. All others are compared only where both runs were on the same machine.
"""

from __future__ import annotations

import statistics
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from rich.console import Console

from load_tests.figures import FOLDER, KEPT, Noted, Run, read_kept, read_runs
from load_tests.goals import GOALS, Goal

__all__ = ["Change", "Verdict", "changes", "print_changes"]

ASSUMED_SPREAD = 0.1  # of the figure: of one that was measured once
_LASTING = ("×", "", "bytes a message", "KiB", "MiB")  # units of what a faster machine does not change


class Verdict(Enum):
    """What became of a figure."""

    WORSE = "slower"
    BETTER = "faster"
    SAME = "as before"
    NOT_COMPARED = "not compared"


@dataclass(frozen=True, slots=True)
class Change:
    """A figure of two runs. `before`, `now`: medians; `spread`: of the rounds, the wider of both runs'; in one unit."""

    goal: Goal
    verdict: Verdict
    before: float = 0.0
    now: float = 0.0
    spread: float = 0.0
    unit: str = ""


def changes(before: Mapping[str, Run], now: Mapping[str, Run], names: Collection[str] = ()) -> list[Change]:
    """Every figure that both have, of these benchmarks; of all without names."""
    found = []
    for goal in GOALS:
        old, new = before.get(goal.run), now.get(goal.run)
        if (names and goal.benchmark not in names) or old is None or new is None:
            continue
        if goal.figure in old.figures and goal.figure in new.figures:
            found.append(_change(goal, old, new))
    return found


def print_changes(names: Collection[str] = (), *, console: Console, file: Path = KEPT, folder: Path = FOLDER) -> None:
    """Name what became worse or better than what is published, and count the rest."""
    found = changes(read_kept(file), read_runs(folder), names)
    if not found:
        return
    for change in (one for verdict in (Verdict.WORSE, Verdict.BETTER) for one in found if one.verdict is verdict):
        text = f"{change.now:,.4g} {change.unit}, was {change.before:,.4g}; the rounds differ by {change.spread:,.3g}"
        style = "bold red" if change.verdict is Verdict.WORSE else "green"
        console.print(f"  {change.verdict.value}: {change.goal.run}: {change.goal.figure}: {text}", style=style)
    counts = {verdict: sum(one.verdict is verdict for one in found) for verdict in Verdict}
    told = ", ".join(f"{count} {verdict.value}" for verdict, count in counts.items() if count)
    console.print(f"Beside the published runs: {told}.", highlight=False)
    if counts[Verdict.NOT_COMPARED]:
        console.print("  Not compared is what only the same machine can repeat.", style="dim")


def _change(goal: Goal, old: Run, new: Run) -> Change:
    before, now = old.figures[goal.figure], new.figures[goal.figure]
    less, unit = goal.less, goal.unit
    if before.peer and now.peer and all((*before.peer, *now.peer)) and all((*before.values, *now.values)):
        left, right = _of_peer(before), _of_peer(now)
        unit = f"of {goal.peer}'s"
    elif unit in _LASTING or old.machine == new.machine:
        left, right = before.values, now.values
    else:
        return Change(goal, Verdict.NOT_COMPARED)
    middles = statistics.median(left), statistics.median(right)
    spread = max(_spread(left), _spread(right))
    worse_by = (middles[1] - middles[0]) * (1 if less else -1)
    verdict = Verdict.WORSE if worse_by > spread else Verdict.BETTER if -worse_by > spread else Verdict.SAME
    return Change(goal, verdict, *middles, spread, unit)


def _of_peer(noted: Noted) -> list[float]:
    """Round by round where both have as many, else of the peer's median."""
    if len(noted.values) == len(noted.peer):
        return [one / other for one, other in zip(noted.values, noted.peer, strict=True)]
    return [one / statistics.median(noted.peer) for one in noted.values]


def _spread(values: list[float]) -> float:
    return max(values) - min(values) if len(values) > 1 else abs(values[0]) * ASSUMED_SPREAD
