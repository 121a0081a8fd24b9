"""Times of many calls in figures, and figures of several rounds in a line."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["Calls", "median", "spread"]


@dataclass(frozen=True, slots=True)
class Calls:
    """Some calls: how long each took, how many failed, how long all of them took."""

    took_ms: tuple[float, ...]
    failed: int
    total_s: float

    @property
    def p50_ms(self) -> float:
        """The median; infinite where no call came back."""
        return self._part(0.50)

    @property
    def p99_ms(self) -> float:
        """What 99 of 100 stay under."""
        return self._part(0.99)

    @property
    def per_s(self) -> float:
        """Good calls a second."""
        return len(self.took_ms) / self.total_s

    def _part(self, part: float) -> float:
        if not self.took_ms:
            return float("inf")
        return sorted(self.took_ms)[min(len(self.took_ms) - 1, int(part * len(self.took_ms)))]


def median(values: Sequence[float]) -> float:
    """Of the rounds."""
    return statistics.median(values)


def spread(values: Sequence[float], digits: int = 2) -> str:
    """The median with the lowest and the highest round."""
    return f"{median(values):.{digits}f} ({min(values):.{digits}f} to {max(values):.{digits}f})"
