"""What goes wrong in a made-up series: each fault changes its values in place, from one row on.

Sizes are by the series' own spread (the distance of its 5 % and 95 % quantiles), lengths by its day in rows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

__all__ = ["FAULTS"]

Fault = Callable[[np.ndarray, int, int, np.random.Generator], None]


def _range(values: np.ndarray) -> tuple[float, float, float]:
    """Low and high end of the usual values, and how far apart they are; never 0."""
    low, high = np.quantile(values, (0.05, 0.95)).tolist()
    return low, high, max(high - low, 1e-3 * max(abs(high), 1.0))


def _spike(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """One to four rows far above."""
    size = int(rng.integers(1, 5))
    values[at : at + size] += rng.uniform(1.0, 4.0) * _range(values)[2]


def _burst(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """Comes at once, goes slowly, and is as noisy as it is large."""
    size = min(int(day * rng.uniform(0.04, 0.4)) + 2, len(values) - at)
    shape = np.exp(-np.arange(size) / (size / 3.0)) * rng.gamma(6.0, 1.0 / 6.0, size)
    values[at : at + size] += rng.uniform(1.0, 6.0) * _range(values)[2] * shape


def _drop(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """Down to below what is usual, for minutes up to half a day."""
    low, _, wide = _range(values)
    size = int(day * rng.uniform(0.01, 0.5)) + 1
    values[at : at + size] = (
        low - rng.uniform(0.05, 1.0) * wide + 0.02 * wide * rng.normal(size=len(values[at : at + size]))
    )


def _dip(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """Slowly down and up again within hours, as far as the lowest usual values or below."""
    low, _, wide = _range(values)
    size = min(int(day * rng.uniform(0.05, 0.2)) + 3, len(values) - at)
    part = np.sin(np.linspace(0.0, np.pi, size))
    inside = values[at : at + size]
    inside += part * (low - rng.uniform(0.0, 0.6) * wide - inside)


def _shift(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """Another level, for a day up to the end."""
    size = len(values) if rng.random() < 0.4 else int(day * rng.uniform(0.5, 4.0)) + 8
    values[at : at + size] += rng.choice((-1.0, 1.0)) * rng.uniform(0.4, 1.2) * _range(values)[2]


def _flat(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """A value that stays where it is for half a day up to two."""
    values[at : at + int(day * rng.uniform(0.5, 2.0)) + 4] = values[at]


def _no_peak(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """A day or two without what is highest in each."""
    low, high, _ = _range(values)
    inside = values[at : at + int(day * rng.uniform(1.0, 2.0))]
    np.minimum(inside, low + 0.3 * (high - low) * rng.random(len(inside)), out=inside)


def _shifted_day(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """A day that comes hours too late."""
    late = int(day * rng.uniform(0.2, 0.5))
    inside = slice(max(at, late), at + int(day * rng.uniform(0.8, 1.5)))
    values[inside] = values[inside.start - late : min(inside.stop, len(values)) - late].copy()


def _jitter(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """A noise that was not there, for hours."""
    inside = values[at : at + int(day * rng.uniform(0.1, 1.0)) + 4]
    inside += rng.uniform(0.15, 0.5) * _range(values)[2] * rng.normal(size=len(inside))


def _long_job(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """High for hours, at any time of the day, as high as usual."""
    _, high, wide = _range(values)
    inside = values[at : at + int(day * rng.uniform(0.15, 1.0)) + 3]
    inside[:] = high * rng.uniform(0.9, 1.02) + 0.03 * wide * rng.normal(size=len(inside))


def _wear(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """Drifts away for two days, then falls out of all that is usual until it is repaired."""
    low, _, wide = _range(values)
    before = values[max(at - 2 * day, 0) : at]
    before -= np.linspace(0.0, 0.5, len(before)) * wide
    inside = values[at : at + int(day * rng.uniform(0.1, 0.6))]
    inside[:] = low - rng.uniform(0.3, 1.5) * wide + 0.05 * wide * rng.normal(size=len(inside))


def _denser(values: np.ndarray, at: int, day: int, rng: np.random.Generator) -> None:
    """What is high now and then is high several times as often, for hours."""
    _, high, _ = _range(values)
    peak = float(np.quantile(values, 0.99))
    inside = values[at : at + int(day * rng.uniform(0.2, 1.0)) + 4]
    inside[rng.random(len(inside)) < rng.uniform(0.2, 0.6)] = max(peak, high) * rng.uniform(0.9, 1.05)


FAULTS: dict[str, Fault] = {
    "spike": _spike,
    "burst": _burst,
    "drop": _drop,
    "dip": _dip,
    "shift": _shift,
    "flat": _flat,
    "no_peak": _no_peak,
    "shifted_day": _shifted_day,
    "jitter": _jitter,
    "long_job": _long_job,
    "wear": _wear,
    "denser": _denser,
}
