"""Families that nothing was chosen with: written when the detectors were done, which were not changed for them.

Whoever changes a detector because of what these say moves them to `families.CHECKING`, and writes others.
"""

from __future__ import annotations

import numpy as np

from load_tests.anomaly.families import DAY_S, FIVE_MIN, HOUR, Array, Family, Rng

__all__ = ["UNSEEN"]


def _tank(t: Array, rng: Rng) -> Array:
    """How full a tank is: drawn from at an uneven rate, filled again whenever it is low."""
    level, values = 80.0, np.empty(len(t))
    drawn = rng.uniform(0.1, 0.8) * rng.gamma(2.0, 0.5, len(t))
    low, fill = rng.uniform(15.0, 35.0), rng.uniform(3.0, 12.0)
    filling = False
    for at, part in enumerate(drawn.tolist()):
        filling = level < low or (filling and level < 90.0)
        level += fill - part if filling else -part
        values[at] = level
    return values + 0.2 * rng.normal(size=len(t))


def _solar(t: Array, rng: Rng) -> Array:
    """Power of a solar panel: a bell by day, clouds that come and go, nothing at night."""
    hour = t % DAY_S / 3600.0
    bell = np.clip(np.cos((hour - 12.5) / rng.uniform(13.0, 16.0) * np.pi), 0.0, 1.0) * (np.abs(hour - 12.5) < 7.0)
    day = (t // DAY_S - t[0] // DAY_S).astype(int)
    cloudy = rng.uniform(0.0, 0.7, day.max() + 1)[day]
    clouds = 1.0 - cloudy * np.repeat(rng.random(len(t) // 5 + 1), 5)[: len(t)]
    power: Array = np.round(rng.uniform(300.0, 5000.0) * bell * clouds, 1)
    return power


def _queue(t: Array, rng: Rng) -> Array:
    """How many wait: they come at random and are served at random, almost as fast."""
    served = rng.uniform(4.0, 30.0)
    steps = rng.poisson(served * rng.uniform(0.8, 0.95), len(t)) - rng.poisson(served, len(t))
    waiting, values = 0, np.empty(len(t))
    for at, step in enumerate(steps.tolist()):
        waiting = max(waiting + step, 0)
        values[at] = waiting
    return values


def _pump(t: Array, rng: Rng) -> Array:
    """Pressure behind a pump: strokes of some rows each, never quite the same, around a slow mean."""
    phase = np.cumsum(2.0 * np.pi / rng.uniform(8.0, 40.0) * (1.0 + 0.05 * rng.normal(size=len(t))))
    slow = np.cumsum(rng.normal(size=len(t))) * 0.003
    return 10.0 + slow + rng.uniform(0.5, 3.0) * np.sin(phase) + rng.uniform(0.05, 0.4) * rng.normal(size=len(t))


def _door(t: Array, rng: Rng) -> Array:
    """How often a door opens in an hour: few times, more at certain hours of working days."""
    hour, working = t % DAY_S / 3600.0, (t // DAY_S + 4) % 7 < 5
    rush = np.exp(-(((hour - 8.5) / 1.5) ** 2)) + 0.8 * np.exp(-(((hour - 17.0) / 2.0) ** 2))
    return rng.poisson(rng.uniform(4.0, 40.0) * (0.03 + rush * np.where(working, 1.0, 0.1))).astype(float)


UNSEEN = (
    Family(name="tank", usual=_tank, faults=("spike", "flat", "drop", "jitter"), rows=(4000, 9000), step_s=FIVE_MIN),
    Family(name="solar", usual=_solar, faults=("no_peak", "long_job", "burst"), rows=(4000, 9000), step_s=FIVE_MIN,
           most_faults=2),
    Family(name="queue", usual=_queue, faults=("burst", "shift", "flat"), rows=(4000, 16_000), step_s=FIVE_MIN,
           whole=True),
    Family(name="pump", usual=_pump, faults=("flat", "jitter", "spike", "shift"), rows=(1200, 5000), step_s=FIVE_MIN),
    Family(name="door", usual=_door, faults=("burst", "long_job", "no_peak"), rows=(1000, 4000), step_s=HOUR,
           most_faults=2, whole=True),
)  # fmt: skip
