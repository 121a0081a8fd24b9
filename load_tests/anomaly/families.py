"""Families of made-up series with known faults: what the detectors are validated on where NAB's files are too few.

Each family is a generator of its own: what the series usually does, and which faults befall it. Lengths, steps and
windows are like NAB's (a tenth of a series is window, shared by its faults, each in the middle of its own), so that the
same scorer judges them. What the detectors look at was chosen with `TUNING` in view, their limits with `CHECKING` too;
those of `unseen_families.py` are for afterwards. No generator is in two of them. All is drawn from a seed:
`make_series(families, seed=1)` gives the same numbers each time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from load_tests.anomaly.made_faults import FAULTS
from load_tests.anomaly.nab_files import Series

__all__ = ["CHECKING", "DAY_S", "FIVE_MIN", "HOUR", "TUNING", "Array", "Family", "Rng", "make_series"]

START_S = 1_767_225_600.0  # a Thursday, midnight
DAY_S = 86_400.0
Rng = np.random.Generator
Array = np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """One kind of series: its usual values by the time of each row, and the faults that befall it."""

    name: str
    usual: Callable[[Array, Rng], Array]
    faults: tuple[str, ...]
    rows: tuple[int, int]
    step_s: float
    most_faults: int = 3
    uneven: bool = False  # rows come late or not at all, as in traffic detectors
    whole: bool = False  # values are counts: whole, not below 0


def make_series(families: Sequence[Family], *, seed: int, each: int = 6) -> list[Series]:
    """`each` series of every family, one in six of them without a fault."""
    numbered = ((place, family, number) for place, family in enumerate(families) for number in range(each))
    return [_make(family, number, np.random.default_rng([seed, place, number])) for place, family, number in numbered]


def _make(family: Family, number: int, rng: Rng) -> Series:
    rows = int(np.exp(rng.uniform(*np.log(family.rows))))
    steps_s = np.full(rows, family.step_s)
    if family.uneven:
        steps_s += rng.integers(0, 3, rows) * 60.0 + (rng.random(rows) < 0.02) * rng.integers(1, 24, rows) * 3600.0
    stamps_s = START_S + rng.integers(0, 7 * 24) * 3600.0 + np.cumsum(steps_s) - steps_s[0]
    values = family.usual(stamps_s, rng)
    count = 0 if number % 6 == 5 else int(rng.integers(1, family.most_faults + 1))
    windows = []
    for middle in _places(rows, count, rng):
        kind = family.faults[rng.integers(len(family.faults))]
        FAULTS[kind](values, middle, max(2, int(DAY_S / family.step_s)), rng)
        half = rows // (20 * count)
        windows.append((max(middle - half, 0), min(middle + half, rows - 1)))
    if family.whole:
        values = np.maximum(np.round(values), 0.0)
    name = f"{family.name}/{number:02}.csv"
    return Series(name=name, stamps_s=stamps_s, values=np.round(values, 6), windows=tuple(windows))


def _places(rows: int, count: int, rng: Rng) -> list[int]:
    """Where faults begin: one in each equal part of what is behind the probation, apart from its ends."""
    first = rows * 0.22
    part = (rows * 0.94 - first) / max(count, 1)
    return [int(first + part * (number + rng.uniform(0.15, 0.85))) for number in range(count)]


def _day(stamps_s: Array, *, peak_h: float, sharp: float = 1.0) -> Array:
    """0 to 1 over the day, 1 at the peak's hour."""
    wave = 0.5 + 0.5 * np.cos((stamps_s % DAY_S / 3600.0 - peak_h) / 24.0 * 2.0 * np.pi)
    shaped: Array = wave**sharp
    return shaped


def _weekday(stamps_s: Array, weekend: float) -> Array:
    return np.where((stamps_s // DAY_S + 4) % 7 < 5, 1.0, weekend)


def _slow(rows: int, keep: float, rng: Rng) -> Array:
    """A noise of deviation 1 that keeps a part of itself from row to row."""
    noise = rng.normal(size=rows) * np.sqrt(1.0 - keep * keep)
    state, made = float(rng.normal()), np.empty(rows)
    for at, push in enumerate(noise.tolist()):
        state = keep * state + push
        made[at] = state
    return made


def _visits(t: Array, rng: Rng) -> Array:
    """Visitors of a site by half hour or five minutes: day, week, a slow trend, counting noise."""
    level = rng.uniform(50.0, 3000.0) * (0.15 + _day(t, peak_h=rng.uniform(10.0, 20.0), sharp=rng.uniform(0.7, 2.0)))
    level *= _weekday(t, rng.uniform(0.4, 1.1)) * np.exp(0.08 * _slow(len(t), 0.995, rng))
    return rng.poisson(level).astype(float)


def _jobs(t: Array, rng: Rng) -> Array:
    """A processor's per cent: idle, and jobs at their hours or at random that take it up to a plateau."""
    idle, plateau, noise = rng.uniform(0.5, 8.0), rng.uniform(20.0, 90.0), rng.uniform(0.05, 1.5)
    values = idle + noise * np.abs(rng.normal(size=len(t)))
    every, lasts = int(rng.choice([24, 72, 144, 288])), int(rng.integers(1, 18))
    for start in range(int(rng.integers(every)), len(t), every):
        begin = start + int(rng.integers(-2, 3) if rng.random() < 0.5 else 0)
        inside = values[max(begin, 0) : begin + lasts]
        inside += plateau * rng.uniform(0.85, 1.1) + noise * rng.normal(size=len(inside))
    return np.clip(values, 0.0, 100.0)


def _machine(t: Array, rng: Rng) -> Array:
    """A temperature with slow moods, a small daily wave and shut-downs that it recovers from."""
    values = 80.0 + rng.uniform(3.0, 8.0) * _slow(len(t), 0.9985, rng) + 0.3 * rng.normal(size=len(t))
    return values + rng.uniform(0.0, 4.0) * _day(t, peak_h=15.0)


def _price(t: Array, rng: Rng) -> Array:
    """What a click costs by the hour: positive, skewed, a spike now and then."""
    values = rng.uniform(0.05, 0.8) * np.exp(
        rng.uniform(0.1, 0.35) * _slow(len(t), 0.6, rng) + 0.3 * _day(t, peak_h=20)
    )
    spikes = rng.random(len(t)) < 0.006
    values *= np.where(spikes, rng.uniform(1.5, 3.0, len(t)), 1.0)
    return np.asarray(values)


def _walk(t: Array, rng: Rng) -> Array:
    """A level that wanders and comes back, read in steps of the sensor."""
    values = rng.uniform(5.0, 50.0) * _slow(len(t), 0.998, rng)
    return np.round(values / 0.1) * 0.1


def _mentions(t: Array, rng: Rng) -> Array:
    """Mentions of a name in five minutes: counts with long tails and echoes, more of them by day."""
    mean, shape = np.exp(rng.uniform(np.log(1.5), np.log(60.0))), rng.uniform(0.8, 4.0)
    level = mean * (0.4 + 1.2 * _day(t, peak_h=16.0)) * _weekday(t, rng.uniform(0.5, 1.0))
    echo = np.zeros(len(t))
    for at in np.flatnonzero(rng.random(len(t)) < 0.002):
        length = int(rng.integers(3, 30))
        decay = mean * rng.pareto(2.5) * np.exp(-np.arange(length) / (length / 3.0))
        echo[at : at + length] += decay[: len(t) - at]
    return np.asarray(rng.poisson((level + echo) * rng.gamma(shape, 1.0 / shape, len(t))), dtype=float)


def _bytes(t: Array, rng: Rng) -> Array:
    """Bytes of an interface: log-normal chatter, and transfers in a rhythm of hours."""
    values = rng.uniform(1e3, 1e5) * np.exp(rng.uniform(0.1, 0.7) * rng.normal(size=len(t)))
    big, every = values.mean() * rng.uniform(5.0, 80.0), int(rng.integers(6, 150))
    starts = np.arange(int(rng.integers(every)), len(t), every)
    values[starts] += big * np.exp(0.2 * rng.normal(size=len(starts)))
    return values


def _road(t: Array, rng: Rng) -> Array:
    """Speeds on a road: free flow, and rush hours that slow it, other ones each day."""
    slow = rng.uniform(0.2, 0.6) * _day(t, peak_h=rng.uniform(7.0, 18.0), sharp=8.0) * _weekday(t, 0.3)
    slow *= np.repeat(rng.uniform(0.3, 1.2, len(t) // 100 + 1), 100)[: len(t)]
    speed = rng.uniform(55.0, 75.0) * (1.0 - slow) + rng.uniform(1.5, 4.0) * rng.normal(size=len(t))
    return np.asarray(np.round(speed))


def _office(t: Array, rng: Rng) -> Array:
    """Keys pressed in an office: bursts in working hours, next to nothing at night and at the weekend."""
    hour = t % DAY_S / 3600.0
    working = (hour > rng.uniform(7.0, 9.5)) & (hour < rng.uniform(16.0, 19.0)) & (_weekday(t, 0.0) > 0.0)
    busy = working & (_slow(len(t), 0.9, rng) > -0.6)
    return np.where(busy, rng.gamma(1.5, rng.uniform(100.0, 800.0), len(t)), rng.random(len(t)) < 0.01)


def _latency(t: Array, rng: Rng) -> Array:
    """Milliseconds of a request: gamma around a steady mean, with a slow wave and some outliers."""
    values = rng.uniform(5.0, 60.0) * (1.0 + 0.1 * _slow(len(t), 0.99, rng)) * rng.gamma(20.0, 0.05, len(t))
    return values * np.where(rng.random(len(t)) < 0.002, rng.uniform(1.3, 1.8, len(t)), 1.0)


def _levels(t: Array, rng: Rng) -> Array:
    """How many of something are at work: a few whole levels, each held for a while, more by day."""
    most = int(rng.integers(4, 40))
    wanted = most * (0.3 + 0.7 * _day(t, peak_h=14.0)) * (1.0 + 0.1 * _slow(len(t), 0.98, rng))
    return np.round(np.repeat(wanted[::6], 6)[: len(t)])


def _pulse(t: Array, rng: Rng) -> Array:
    """A plant that runs from one hour to another each day, with noise of its gauge."""
    hour, begins, lasts = t % DAY_S / 3600.0, rng.uniform(4.0, 12.0), rng.uniform(3.0, 10.0)
    running = (hour >= begins) & (hour < begins + lasts)
    return rng.uniform(10.0, 40.0) + rng.uniform(30.0, 80.0) * running + rng.uniform(0.5, 5.0) * rng.random(len(t))


FIVE_MIN, HOUR = 300.0, 3600.0
TUNING = (
    Family(name="visits", usual=_visits, faults=("burst", "drop", "no_peak", "shifted_day", "flat"),
           rows=(4000, 10_500), step_s=1800.0 / 3, whole=True),
    Family(name="jobs", usual=_jobs, faults=("spike", "shift", "no_peak", "jitter", "long_job"), rows=(4000, 5000),
           step_s=FIVE_MIN, most_faults=2),
    Family(name="machine", usual=_machine, faults=("drop", "wear", "shift", "jitter"), rows=(7000, 22_000),
           step_s=FIVE_MIN),
    Family(name="price", usual=_price, faults=("spike", "burst", "shift"), rows=(1500, 1700), step_s=HOUR),
    Family(name="walk", usual=_walk, faults=("spike", "shift", "flat", "jitter"), rows=(1000, 5000), step_s=FIVE_MIN),
)  # fmt: skip
CHECKING = (
    Family(name="mentions", usual=_mentions, faults=("burst", "burst", "spike"), rows=(15_800, 15_950),
           step_s=FIVE_MIN, most_faults=4, whole=True),
    Family(name="bytes", usual=_bytes, faults=("spike", "shift", "denser", "burst"), rows=(1200, 5000),
           step_s=FIVE_MIN, most_faults=2),
    Family(name="road", usual=_road, faults=("drop", "dip", "flat", "shift"), rows=(1100, 2500), step_s=FIVE_MIN,
           most_faults=4, uneven=True),
    Family(name="office", usual=_office, faults=("burst", "long_job", "no_peak"), rows=(1900, 5300), step_s=FIVE_MIN,
           most_faults=2),
    Family(name="latency", usual=_latency, faults=("spike", "shift", "jitter", "burst"), rows=(4000, 5000),
           step_s=FIVE_MIN),
    Family(name="levels", usual=_levels, faults=("shift", "drop", "flat", "long_job"), rows=(4000, 8000),
           step_s=FIVE_MIN, most_faults=2),
    Family(name="pulse", usual=_pulse, faults=("no_peak", "long_job", "shift", "drop"), rows=(4000, 4100),
           step_s=FIVE_MIN, most_faults=1),
)  # fmt: skip
