"""The detector of one series in plain Python: the same scores as `bank.py`, to the last bit, for files and tests."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from itertools import pairwise

from gateway.alerting.anomaly.detectors.novelty import SMALLEST_SPREAD
from gateway.alerting.anomaly.detectors.page import LARGEST
from gateway.alerting.anomaly.explanation import Explanation, Judged, Learned, band, explain, learned
from gateway.alerting.anomaly.parameters import FIXED, NOVELTIES, THRESHOLD, BankConfig

__all__ = ["Stream"]


class Stream:
    """One series. Feed its samples; each gets its score before it is learned."""

    def __init__(self, config: BankConfig = FIXED, *, times: float = 1.0) -> None:
        self.config = config
        self.ignored = 0
        self._times = times
        self._novelties = tuple(_Novelty(config) for _ in NOVELTIES)
        self._allowed = times * (config.limit * config.times)
        profile_s = max(config.learn_s, config.profile_learn_s)
        self._learn_s = (config.learn_s, profile_s, config.learn_s, config.learn_s)
        self._profile, self._window, self._lowest = _Profile(config), _Window(config), _Lowest(config)
        self._stamp_s, self._raised_keeps = math.nan, config.raised_keeps
        self._elapsed_s = self._count = self._quiet_count = self._quiet_s = self._raised = 0.0
        self._last = Judged(0.0, 0.0, 0, 0.0, 0.0, 0.0, math.nan)

    def update(self, stamp_s: float, value: float) -> float:
        """The score of a sample in [0, 1]; at least 0.5 is an alert. What is no number scores 0."""
        if not (math.isfinite(stamp_s) and math.isfinite(value)):
            self.ignored += 1
            return 0.0
        value = min(max(value, -LARGEST), LARGEST) + 0.0  # no -0.0
        learned_s = self._elapsed_s
        self._pass(stamp_s)
        usual = self._profile.usual(stamp_s, value)
        x = (value, *self._window.of(value, value - usual), self._lowest.of(value))
        least = self._novelties[0].least_spread()
        told = (0.0, 0.0, 0.0)  # strength, nearest, reach
        which, strongest = 0, 0.0
        for number, novelty in enumerate(self._novelties):
            if math.isfinite(x[number]):
                enough = learned_s >= self._learn_s[number]
                found = novelty.evaluate(x[number], self._allowed, least, enough)
                strongest = max(strongest, found[0])
                if not number or (found[0] > told[0] and (which or told[0] < 1.0)):  # a new value is told as such
                    told, which = found, number
        self._raised *= self._raised_keeps
        ratio = strongest / (1.0 + self.config.raised * self._raised)
        score = self._calm(ratio / (1.0 + ratio))
        self._last = Judged(value, score, which, x[which], told[1], told[2], usual)
        return score

    def _pass(self, stamp_s: float) -> None:
        step = stamp_s - self._stamp_s
        if step > 0.0:
            self._elapsed_s += min(step, self.config.longest_step_s)
        self._stamp_s = stamp_s
        self._count += 1.0

    def _calm(self, score: float) -> float:
        """Half the score while the series cools down; an alert starts that, and raises the limit for longer."""
        if self._count <= self._quiet_count or self._elapsed_s < self._quiet_s:
            score *= 0.5
        if score >= THRESHOLD:
            self._quiet_count = self._count + self.config.cooldown_samples
            self._quiet_s = self._elapsed_s + self.config.cooldown_s
            self._raised += 1.0
        return score

    def accept(self, value: float, stamp_s: float | None = None) -> None:
        """ "This is normal": the value counts as seen."""
        usual = self._profile.at(self._stamp_s if stamp_s is None else stamp_s)
        for novelty, x in zip(
            self._novelties, (value, value - usual, self._window.range_with(value), value), strict=True
        ):
            if math.isfinite(x) and abs(x) <= LARGEST:
                novelty.accept(x)

    @property
    def learned(self) -> Learned:
        """How far the learning is; scores are 0 until it is over."""
        return learned(self.config, seen=self._count, elapsed_s=self._elapsed_s)

    def explain(self) -> Explanation:
        """Why the last sample got its score."""
        return explain(self.config, self._last, self._novelties[self._last.novelty].kept, self.learned)

    def band(self) -> tuple[float, float]:
        """Low and high end of what is expected next, around the last value."""
        values = self._novelties[0]
        nearest, _, spread = values.look(self._last.value, values.least_spread())[1:]
        return band(values.kept, nearest, spread * (self.config.limit * self.config.times) * self._times)


class _Novelty:
    """The distinct values seen, sorted, and their mean and spread."""

    def __init__(self, config: BankConfig) -> None:
        self._config = config
        self.kept: list[float] = []
        self._gap = self._seen = self._mean = self._square = 0.0

    def least_spread(self) -> float:
        """What differences of a series whose values these are are measured by at least."""
        spread = math.sqrt(self._square / max(self._seen, 1.0))
        return max(abs(self._mean) * self._config.spread_floor, spread * self._config.spread_share, SMALLEST_SPREAD)

    def look(self, x: float, least: float) -> tuple[int, float, float, float]:
        """Place, nearest kept value, distance to it, spread."""
        kept, at = self.kept, bisect_left(self.kept, x)
        below = kept[at - 1] if at else -math.inf
        above = kept[at] if at < len(kept) else math.inf
        down, up = x - below, above - x
        spread = math.sqrt(self._square / max(self._seen, 1.0))
        return at, below if down <= up else above, min(down, up), max(spread, least)

    def evaluate(self, x: float, allowed: float, least: float, enough: bool) -> tuple[float, float, float]:
        """Strength by the limit, nearest kept value, reach; then learns x."""
        at, nearest, distance, spread = self.look(x, least)
        reach = spread * allowed
        strength = distance / reach if enough and self._seen >= self._config.learn_samples else 0.0
        if distance > max(spread * self._config.spacing, self._gap):
            self._insert(at, x)
        self._learn(x)
        return strength, nearest, reach

    def accept(self, x: float) -> None:
        """Keep x unless it is kept already."""
        at, _, distance, _ = self.look(x, 0.0)
        if distance > 0.0:
            self._insert(at, x)

    def _learn(self, x: float) -> None:
        if self._seen < self._config.memory_samples:
            self._seen += 1.0
        else:
            self._square *= 1.0 - 1.0 / self._config.memory_samples
        delta, part = x - self._mean, 1.0 / self._seen
        self._mean += delta * part
        self._square += delta * delta * (1.0 - part)

    def _insert(self, at: int, x: float) -> None:
        kept = self.kept
        kept.insert(at, x)
        if len(kept) > self._config.places - 2:
            gaps = [after - before for before, after in pairwise(kept)]
            self._gap = min(gaps)
            nearest = gaps.index(self._gap)
            kept[nearest : nearest + 2] = [(kept[nearest] + kept[nearest + 1]) * 0.5]


class _Profile:
    """What is usual at an hour of the day."""

    def __init__(self, config: BankConfig) -> None:
        self._config = config
        self._usual = [math.nan] * config.bins
        self._bin, self._sum, self._count = -1, 0.0, 0.0

    def usual(self, stamp_s: float, value: float) -> float:
        """Before today, at the stamp's hour; NaN where that is new. Then learns the value."""
        now = self._hour(stamp_s)
        if now != self._bin:
            if self._bin >= 0:
                mean, old = self._sum / self._count, self._usual[self._bin]
                step = self._config.profile_step
                self._usual[self._bin] = mean if math.isnan(old) else old + step * (mean - old)
            self._bin, self._sum, self._count = now, 0.0, 0.0
        self._sum += value
        self._count += 1.0
        return self._usual[now]

    def at(self, stamp_s: float) -> float:
        """What is usual at the stamp's hour; NaN where nothing is known."""
        return self._usual[self._hour(stamp_s)] if math.isfinite(stamp_s) else math.nan

    def _hour(self, stamp_s: float) -> int:
        day_s = self._config.bin_s * self._config.bins
        return min(int(stamp_s % day_s / self._config.bin_s), self._config.bins - 1)


class _Window:
    """The last values, and what they differed by from the profile."""

    def __init__(self, config: BankConfig) -> None:
        self._values = [math.nan] * config.window_samples
        self._differences = [math.nan] * config.window_samples
        self._next = 0

    def of(self, value: float, difference: float) -> tuple[float, float]:
        """Mean of the differences and range of the values, the new ones included; NaN until all are known."""
        self._values[self._next], self._differences[self._next] = value, difference
        self._next = (self._next + 1) % len(self._values)
        total = 0.0
        for one in self._differences:  # sum() rounds otherwise, from Python 3.12 on
            total += one
        wide = math.nan if math.isnan(self._values[self._next]) else max(self._values) - min(self._values)
        return total / len(self._differences), wide

    def range_with(self, value: float) -> float:
        """Of the values as they are and one more; NaN until all are known."""
        known = not math.isnan(self._values[self._next])
        return max(*self._values, value) - min(*self._values, value) if known else math.nan


class _Lowest:
    """The lowest value of the last blocks."""

    def __init__(self, config: BankConfig) -> None:
        self._config = config
        self._done: deque[float] = deque([-math.inf] * (config.blocks - 1), maxlen=config.blocks - 1)
        self._past, self._now, self._count = -math.inf, math.inf, 0

    def of(self, value: float) -> float:
        """With the new value; -inf until there are enough."""
        self._now = min(self._now, value)
        found = min(self._past, self._now)
        self._count += 1
        if self._count == self._config.window_samples:
            self._done.append(self._now)
            self._past, self._now, self._count = min(self._done), math.inf, 0
        return found
