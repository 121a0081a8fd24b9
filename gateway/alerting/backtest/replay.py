"""Stored rows of one robot through an evaluator of their own, in order of time. Pure: a worker's thread runs it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gateway.alerting.anomaly.checks import Check
from gateway.alerting.anomaly.evaluator import Evaluator, EvaluatorConfig
from gateway.alerting.backtest.report import NS, Fired, SeriesReport
from gateway.alerting.backtest.trace import SPANS, Spans, Stamps, Trace, Values
from gateway.domain.channel import Series
from gateway.domain.finding import Edge

__all__ = ["MAX_FIRED", "Columns", "Replay"]

TICKS = 20_000  # a tick is a second, or that part of the time
MAX_FIRED = 2000
SEEN = 60  # seconds of a series, before anything is said of what to expect: wide at first, and narrower with time


@dataclass(frozen=True, slots=True)
class Columns:
    """Some rows of one series, in order of time."""

    series: str
    stamps_ns: Stamps
    values: Values


class Replay:
    """One robot's history from one stamp to another, fed piece by piece."""

    def __init__(
        self, robot: str, series: Sequence[Series], *, start_ns: int, end_ns: int, checks: Sequence[Check]
    ) -> None:
        self._evaluator = Evaluator(EvaluatorConfig(), checks=checks)
        self._evaluator.robot(robot)
        self._robot = robot
        spans = Spans(start_ns, end_ns)
        self._spans, self._span = spans, -1
        self._traces = {item.name: Trace(spans) for item in series}
        self._slots = {item.name: self._evaluator.slot(robot, item.name, topic=item.topic) for item in series}
        self._tick_ns = max(NS, (end_ns - start_ns) // TICKS)
        self._open: dict[tuple[str, str, str], Fired] = {}
        self._over: list[Fired] = []

    @property
    def full(self) -> bool:
        """Whether so much would have fired that nobody reads on."""
        return len(self._open) + len(self._over) >= MAX_FIRED

    def feed(self, columns: Sequence[Columns], *, from_ns: int, until_ns: int) -> None:
        """All rows of a piece of the time, which begins where the last one ended."""
        for item in columns:
            self._traces[item.series].add(item.stamps_ns, item.values)
        slots = np.concatenate([np.full(len(c.stamps_ns), self._slots[c.series], np.int64) for c in columns] or [_NONE])
        stamps = np.concatenate([item.stamps_ns for item in columns] or [_NONE])
        values = np.concatenate([item.values for item in columns] or [np.empty(0)])
        order = np.argsort(stamps, kind="stable")
        slots, stamps, values = slots[order], stamps[order], values[order]
        ticks = np.arange(from_ns + self._tick_ns, until_ns + self._tick_ns, self._tick_ns, dtype=np.int64)
        begin = 0
        for at_ns, end in zip(ticks.tolist(), np.searchsorted(stamps, ticks).tolist(), strict=True):
            if end > begin:
                self._evaluator.samples(slots[begin:end], stamps[begin:end] / 1e9, values[begin:end])
            begin = end
            self._tick(min(at_ns, until_ns))

    def fired(self) -> tuple[Fired, ...]:
        """Every finding that would have opened, in order of time."""
        return tuple(sorted([*self._over, *self._open.values()], key=lambda item: item.opened_ns))

    def series(self) -> tuple[SeriesReport, ...]:
        """The series that had rows, those first of which something would have fired."""
        odd = {item.finding.series for item in (*self._over, *self._open.values())}
        names = sorted((name for name, trace in self._traces.items() if trace.samples), key=lambda n: (n not in odd, n))
        traces = ((name, self._traces[name]) for name in names)
        return tuple(SeriesReport(series=name, samples=t.samples, points=t.points()) for name, t in traces)

    def _tick(self, now_ns: int) -> None:
        self._take(self._evaluator.tick(now_ns / 1e9))
        span = min(self._spans.of(now_ns), SPANS - 1)
        if span != self._span:
            self._span = span
            self._look(span)

    def _look(self, span: int) -> None:
        """What is expected of each series in the span that begins."""
        for name, slot in self._slots.items():
            if slot < 0:
                continue
            if self._evaluator.learned(slot).seen < SEEN:
                continue
            low, high = self._evaluator.band(slot)
            if np.isfinite(low) and np.isfinite(high):
                self._traces[name].expect(span, low, high)

    def _take(self, edges: Iterable[Edge]) -> None:
        for edge in edges:
            key, at_ns = edge.finding.key, round(edge.at_s * NS)
            before = self._open.get(key)
            if edge.change == "cleared":
                if before is not None:
                    self._over.append(Fired(before.finding, before.opened_ns, at_ns))
                    del self._open[key]
                continue
            self._open[key] = Fired(edge.finding, before.opened_ns if before is not None else at_ns)
            if (trace := self._traces.get(edge.finding.series)) is not None:
                trace.mark(at_ns, edge.finding.score)


_NONE = np.empty(0, np.int64)
