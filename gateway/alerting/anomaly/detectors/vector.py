"""Metrics that do not fit together: the Mahalanobis distance of a robot's newest values from how they usually lie.

Every five seconds a robot's newest values form a vector of up to 64 metrics, smoothed and scaled by what was learnt.
Mean and covariance are exponentially weighted, the covariance is regularised by a part of the identity; the distance
is told when it is three times beyond a high quantile of its own past. A metric that has no fresh value counts as its
mean, and one far out as `widest` deviations, since a single odd metric is the business of other detectors. The
contribution of a metric is its part of the distance: z * (P z), where P is the inverse covariance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gateway.alerting.anomaly.detectors.columns import Bools, Columns, Floats, Ints

__all__ = ["METRICS", "VectorConfig", "VectorVerdict", "Vectors"]

METRICS = 64
ACCEPTED = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class VectorConfig:
    """The one parameter set; counts are of vectors."""

    period_s: float = 5.0
    fresh_s: float = 30.0
    smooth: float = 0.3
    learn: int = 1500
    memory: int = 20_000
    refresh: int = 60
    ridge: float = 0.02
    deviations: float = 2.576  # of the distance's logarithm: its 99.5 % quantile
    factor: float = 3.0
    need: int = 2
    clear: int = 12
    adopt: int = 1440
    widest: float = 4.0  # a metric's scaled value is held within so many deviations


@dataclass(frozen=True, slots=True)
class VectorVerdict:
    """Robots where something opened or closed; `parts` are the metrics' contributions to the distance."""

    robots: Ints
    opened: Bools
    distance: Floats
    limit: Floats
    parts: Floats


class Vectors:
    """The learnt shape of all robots, a row each: 34 KiB with all metrics."""

    def __init__(self, config: VectorConfig = VectorConfig()) -> None:
        self.config = config
        zeros, square = np.zeros(METRICS), np.zeros((METRICS, METRICS), np.float32)
        none = np.float64(-np.inf)
        self.columns = Columns(
            slots=np.full(METRICS, -1, np.int64), newest=zeros, newest_s=np.full(METRICS, none), due_s=none,
            mean=zeros, var=zeros, smooth=zeros, known=np.zeros(METRICS, np.int32), covariance=square, inverse=square,
            seen=np.int32(0), log_mean=np.float64(0), log_var=np.float64(0), out=np.int32(0), inside=np.int32(0),
            distance=np.float64(0), normal=np.float64(0),
        )  # fmt: skip

    def put(self, robots: Ints, places: Ints, values: Floats, at_s: float) -> None:
        """The newest values of some metrics."""
        self.columns["newest"][robots, places] = values
        self.columns["newest_s"][robots, places] = at_s

    def evaluate(self, robots: Ints, at_s: float) -> VectorVerdict | None:
        """Judge the robots whose next vector is due."""
        config, columns = self.config, self.columns
        due_s = columns["due_s"][robots]
        robots = robots[(at_s >= due_s) | (at_s < due_s - 2.0 * config.period_s)]
        if not len(robots):
            return None
        columns["due_s"][robots] = (np.floor(at_s / config.period_s) + 1.0) * config.period_s
        z = self._scaled(robots, at_s)
        parts = z * np.einsum("rij,rj->ri", columns["inverse"][robots], z)
        distance = np.maximum(parts.sum(axis=1), 0.0)
        seen, out = columns["seen"][robots], columns["out"][robots]
        deviations = config.deviations * np.sqrt(columns["log_var"][robots])
        limit = config.factor * np.exp(columns["log_mean"][robots] + deviations)
        limit = np.maximum(limit, columns["normal"][robots])
        columns["distance"][robots] = distance
        outside = (distance > limit) & (seen >= config.learn)
        was_open = out >= config.need
        out = np.where(outside | was_open, out + 1, 0)
        inside = np.where(was_open & ~outside, columns["inside"][robots] + 1, 0)
        opened = (out >= config.need) & ~was_open
        adopted = was_open & (out >= config.adopt)
        closed = (was_open & (inside >= config.clear)) | adopted
        columns["out"][robots], columns["inside"][robots] = np.where(closed, 0, out), np.where(closed, 0, inside)
        learning = ~(was_open | opened) | adopted
        self._learn(robots[learning], z[learning], distance[learning])
        edge = opened | closed
        return VectorVerdict(robots[edge], opened[edge], distance[edge], limit[edge], parts[edge])

    def accept(self, robot: int, distance: float) -> None:
        """So far from usual, and half as far again, is normal for this robot."""
        columns = self.columns
        farthest = max(distance, float(columns["distance"][robot]))
        columns["normal"][robot] = max(float(columns["normal"][robot]), ACCEPTED * farthest)
        columns["out"][robot] = columns["inside"][robot] = 0

    def _scaled(self, robots: Ints, at_s: float) -> Floats:
        """Smoothed values in deviations from the mean; 0 where a metric is unknown or stale. Learns mean and scale."""
        config, columns = self.config, self.columns
        age = at_s - columns["newest_s"][robots]
        fresh = (age >= 0.0) & (age <= config.fresh_s)
        value, known = columns["newest"][robots], columns["known"][robots]
        old = columns["smooth"][robots]
        smooth = np.where(known == 0, value, old + config.smooth * (value - old))
        columns["smooth"][robots] = np.where(fresh, smooth, np.where(known == 0, 0.0, old))
        mean, var = columns["mean"][robots], columns["var"][robots]
        calm = (columns["out"][robots] == 0)[:, None] & fresh
        rate = np.maximum(1.0 / (known + 1.0), 1.0 / config.memory)
        apart = smooth - mean
        held = np.where(known >= config.learn, np.clip(apart, -8.0 * np.sqrt(var), 8.0 * np.sqrt(var)), apart)
        columns["mean"][robots] = np.where(calm, mean + rate * held, mean)
        columns["var"][robots] = np.where(calm, (1.0 - rate) * (var + rate * held * held), var)
        columns["known"][robots] = np.minimum(known + calm, config.memory)
        usable = fresh & (known >= config.refresh) & (var > 0.0)
        z: Floats = np.where(usable, apart / np.sqrt(np.where(var > 0.0, var, 1.0)), 0.0)
        return np.clip(z, -config.widest, config.widest)

    def _learn(self, robots: Ints, z: Floats, distance: Floats) -> None:
        config, columns = self.config, self.columns
        if not len(robots):
            return
        seen = columns["seen"][robots]
        rate = np.maximum(1.0 / (seen + 1.0), 1.0 / config.memory)
        old = columns["covariance"][robots]
        outer = z[:, :, None] * z[:, None, :]
        columns["covariance"][robots] = old + rate[:, None, None] * (outer - old)
        self._learn_limit(robots, distance, seen)
        columns["seen"][robots] = seen + 1
        turning = robots[(seen + 1) % config.refresh == 0]
        if len(turning):
            ridged = columns["covariance"][turning].astype(np.float64) + config.ridge * np.eye(METRICS)
            columns["inverse"][turning] = np.linalg.inv(ridged)

    def _learn_limit(self, robots: Ints, distance: Floats, seen: Ints) -> None:
        """Mean and deviation of the distance's logarithm, once the covariance says something."""
        config, columns = self.config, self.columns
        known = np.maximum(seen - config.learn // 3, 0)
        rate = np.where(seen >= config.learn // 3, np.maximum(1.0 / (known + 1.0), 1.0 / config.memory), 0.0)
        old = columns["log_mean"][robots]
        apart = np.log(np.maximum(distance, 1e-3)) - old
        columns["log_mean"][robots] = old + rate * apart
        columns["log_var"][robots] = (1.0 - rate) * (columns["log_var"][robots] + rate * apart * apart)

    def dump(self) -> dict[str, npt.NDArray[Any]]:
        """All state."""
        return self.columns.dump()
