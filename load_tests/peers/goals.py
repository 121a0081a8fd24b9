"""The goals, each with the measured figure and whether it is reached. Raw is the put with a 33-byte attachment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from load_tests.peers.results import Results
from load_tests.peers.rows import size_name

__all__ = ["GOALS", "Goal", "Verdict", "judge", "ratio"]

_SMALL, _MIB = 64, 1 << 20


@dataclass(frozen=True, slots=True)
class Verdict:
    """One line under the table."""

    text: str
    goal: str
    figure: str
    reached: bool | None  # None: not measured


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """What is wanted of a figure."""

    text: str
    figure: Callable[[Results], tuple[float, str] | None]
    at_least: float | None = None
    at_most: float | None = None
    unit: str = ""

    def each(self, results: Results) -> list[float]:
        """The figure of every round, where it has one a round."""
        return self.figure.each(results) if isinstance(self.figure, RowRatio) else []


@dataclass(frozen=True, slots=True)
class RowRatio:
    """A figure of one row over the same of another: of the medians, and round by round."""

    size: int
    row: str
    other: str
    name: str = "rate"

    def __call__(self, results: Results) -> tuple[float, str] | None:
        """Of the medians; None where either was not measured."""
        found = ratio(*(results.median(self.size, key, self.name) for key in (self.row, self.other)))
        return None if found is None else (found, "")

    def each(self, results: Results) -> list[float]:
        """Of the rounds: empty where not every round has both."""
        own, others = (
            results.cells[self.size, key].values(self.name) if (self.size, key) in results.cells else []
            for key in (self.row, self.other)
        )
        return [mine / theirs for mine, theirs in zip(own, others, strict=True)] if len(own) == len(others) else []


def ratio(upper: float | None, lower: float | None) -> float | None:
    """None where either was not measured."""
    return upper / lower if upper is not None and lower else None


def _threads(row: str) -> Callable[[Results], tuple[float, str] | None]:
    def figure(results: Results) -> tuple[float, str] | None:
        cell = results.many.get(row)
        threads = cell.median("threads_sub") if cell else None
        return None if threads is None else (threads, "")

    return figure


def _worst_round_trip(row: str) -> Callable[[Results], tuple[float, str] | None]:
    """Of all sizes, the one where the row is furthest behind raw Zenoh."""

    def figure(results: Results) -> tuple[float, str] | None:
        found = [
            (value, f" at {size_name(size)}")
            for size in results.sizes
            if (value := ratio(results.median(size, row, "p50_us"), results.median(size, "zenoh", "p50_us")))
            is not None
        ]
        return max(found, default=None)

    return figure


GOALS = (
    Goal(
        text="shared executor, typed 64 B, keep-all, of raw",
        figure=RowRatio(_SMALL, "metaros-all", "zenoh"),
        at_least=0.35,
    ),
    Goal(
        text="shared executor, typed 64 B, keep-last 10 flooded, of raw",
        figure=RowRatio(_SMALL, "metaros-executor", "zenoh"),
        at_least=0.35,
    ),
    Goal(text="threads of a node with 20 subscriptions", figure=_threads("metaros-executor"), at_most=6),
    Goal(text="threads with 20 keep-all subscriptions", figure=_threads("metaros-all"), at_most=8),
    Goal(text="dedicated, typed 64 B, of raw", figure=RowRatio(_SMALL, "metaros-dedicated", "zenoh"), at_least=0.55),
    Goal(text="dedicated, bytes 64 B, of raw", figure=RowRatio(_SMALL, "metaros-bytes", "zenoh"), at_least=0.8),
    Goal(
        text="typed 64 B, dedicated, against cyclonedds-python 11.0.1",
        figure=RowRatio(_SMALL, "metaros-dedicated", "cyclonedds"),
        at_least=4,
        unit="×",
    ),
    Goal(
        text="bytes 1 MiB, against pyzmq 27.3.0", figure=RowRatio(_MIB, "metaros-bytes", "pyzmq"), at_least=1, unit="×"
    ),
    Goal(
        text="bytes 1 MiB, of raw with our settings",
        figure=RowRatio(_MIB, "metaros-bytes", "zenoh-tuned"),
        at_least=0.95,
    ),
    Goal(
        text="typed 1 MiB, shared memory, against cyclonedds-python 11.0.1",
        figure=RowRatio(_MIB, "metaros-shm", "cyclonedds"),
        at_least=5,
        unit="×",
    ),
    Goal(
        text="RTT p50, shared executor, 64 B, of raw",
        figure=RowRatio(_SMALL, "metaros-executor", "zenoh", "p50_us"),
        at_most=1.1,
    ),
    Goal(
        text="RTT p50, shared executor, 64 B, of cyclonedds-python 11.0.1",
        figure=RowRatio(_SMALL, "metaros-executor", "cyclonedds", "p50_us"),
        at_most=1,
    ),
    Goal(
        text="RTT p50, shared executor, of raw: worst size", figure=_worst_round_trip("metaros-executor"), at_most=1.2
    ),
    Goal(text="RTT p50, dedicated, of raw: worst size", figure=_worst_round_trip("metaros-dedicated"), at_most=1.2),
)


def judge(results: Results) -> list[Verdict]:
    """Every goal against the medians, unrounded."""
    return [_verdict(goal, goal.figure(results)) for goal in GOALS]


def _verdict(goal: Goal, found: tuple[float, str] | None) -> Verdict:
    limit = goal.at_least if goal.at_least is not None else goal.at_most
    wanted = f"{'≥' if goal.at_least is not None else '≤'} {limit:g}{goal.unit}"
    if found is None:
        return Verdict(goal.text, wanted, "not measured", None)
    value, where = found
    reached = value >= goal.at_least if goal.at_least is not None else value <= (goal.at_most or 0.0)
    shown = f"{value:.0f}" if value == int(value) else f"{value:.2f}"
    return Verdict(goal.text, wanted, f"{shown}{goal.unit}{where}", reached)
