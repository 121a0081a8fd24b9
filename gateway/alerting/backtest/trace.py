"""What a plot needs of a series: the smallest and the largest value of each of a few hundred spans, and its band."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from gateway.alerting.anomaly.detectors.cells import LARGEST
from gateway.alerting.backtest.report import Point
from gateway.store.telemetry.lttb import extremes

__all__ = ["SPANS", "Spans", "Trace"]

SPANS = 360  # of the whole time
Stamps = npt.NDArray[np.int64]
Values = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Spans:
    """A time in equal spans."""

    start_ns: int
    end_ns: int

    @property
    def width_ns(self) -> int:
        """Of each."""
        return max(1, -(-(self.end_ns - self.start_ns + 1) // SPANS))

    def of(self, stamp_ns: int) -> int:
        """In which of them a stamp is."""
        return (stamp_ns - self.start_ns) // self.width_ns


@dataclass(slots=True)
class Trace:
    """One series."""

    spans: Spans
    samples: int = 0
    _rows: list[tuple[int, float]] = field(default_factory=list)
    _bands: dict[int, tuple[float, float]] = field(default_factory=dict)
    _scores: dict[int, float] = field(default_factory=dict)

    def add(self, stamps_ns: Stamps, values: Values) -> None:
        """Rows in order of time; what is no number, also to the evaluator, is left out."""
        self.samples += len(stamps_ns)
        usable = np.abs(values) < LARGEST
        stamps_ns, values = stamps_ns[usable], values[usable]
        if not len(stamps_ns):
            return
        owner = (stamps_ns - self.spans.start_ns) // self.spans.width_ns
        kept = extremes(values, np.flatnonzero(np.diff(owner, prepend=owner[0] - 1)))
        self._rows += zip(stamps_ns[kept].tolist(), values[kept].tolist(), strict=True)

    def expect(self, span: int, low: float, high: float) -> None:
        """What is expected of a span's values, as it was known when it began."""
        self._bands[span] = (low, high)

    def mark(self, stamp_ns: int, score: float) -> None:
        """How odd the series was then; the highest of a span counts."""
        span = self.spans.of(stamp_ns)
        self._scores[span] = max(score, self._scores.get(span, 0.0))

    def points(self) -> tuple[Point, ...]:
        """What is to be drawn."""
        found = []
        for stamp_ns, value in self._rows:
            span = self.spans.of(stamp_ns)
            low, high = self._bands.get(span, (None, None))
            found.append((stamp_ns, value, low, high, self._scores.get(span, 0.0)))
        return tuple(found)
