"""Lasting changes of a series at four time scales: level, drift, vibration, calm, frequency and sudden steps.

Seconds are gathered into windows of 8, 64 and 512 of them. Each feature of each scale is held against the range in
which it was learnt (`ranges`), so that only what lasts is told. A step is a jump from one second to the next, larger
than the series ever made, that is not taken back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gateway.alerting.anomaly.detectors.cells import Second
from gateway.alerting.anomaly.detectors.columns import Columns, Floats, Ints
from gateway.alerting.anomaly.detectors.ranges import RangeRule, Ranges, Verdict

__all__ = ["FEATURES", "OF_VALUE", "Change", "Feature", "Lasting", "LastingConfig"]

OF_VALUE = ("novelty", "level", "step", "drift")  # kinds whose value is one of the series, and no feature of many
STEP_KEPT_S = 60  # cells for which a step is told


@dataclass(frozen=True, slots=True)
class Feature:
    """One thing looked at: of which scale, and what it is called when it lies above or below what was seen."""

    name: str
    scale: int
    above: str
    below: str
    need: int


FEATURES = (
    Feature("second.mean", 0, "level", "level", 3),
    Feature("second.spread", 0, "vibration", "calm", 4),
    Feature("second.jump", 0, "step", "step", 1),
    Feature("short.mean", 1, "level", "level", 2),
    Feature("short.spread", 1, "vibration", "calm", 3),
    Feature("minute.mean", 2, "drift", "drift", 2),
    Feature("minute.spread", 2, "vibration", "calm", 2),
    Feature("minute.crossings", 2, "frequency", "frequency", 3),
    Feature("long.mean", 3, "drift", "drift", 1),
    Feature("long.spread", 3, "vibration", "calm", 2),
)
_NUMBER = {feature.name: number for number, feature in enumerate(FEATURES)}


@dataclass(frozen=True, slots=True, kw_only=True)
class LastingConfig:
    """The one parameter set. Tuples are by scale: seconds, 8 s, 64 s, 512 s."""

    window: tuple[int, ...] = (1, 8, 64, 512)
    part: tuple[float, ...] = (0.3, 0.2, 0.25, 0.3)
    deviations: tuple[float, ...] = (1.0, 0.4, 0.3, 0.35)
    jump_part: float = 0.5
    spread_part: float = 0.5
    crossings_part: float = 0.5
    learn_s: int = 21_600
    epoch_s: int = 3600
    adopt_s: int = 7200
    memory_s: int = 5 * 86400
    young: float = 0.4
    crossing_deviations: float = 0.3

    def rule(self, feature: Feature) -> RangeRule:
        """How one feature is judged."""
        window = self.window[feature.scale]
        part, deviations = self.part[feature.scale], self.deviations[feature.scale]
        word = feature.name.partition(".")[2]
        if word != "mean":
            part = {"jump": self.jump_part, "spread": self.spread_part}.get(word, self.crossings_part)
        return RangeRule(
            part=part,
            deviations=deviations,
            need=feature.need,
            clear=max(2, 16 // window),
            learn=max(8, self.learn_s // window),
            epoch=max(2, self.epoch_s // window),
            adopt=max(4, self.adopt_s // window),
            memory=self.memory_s // window,
            young=self.young,
        )


@dataclass(frozen=True, slots=True)
class Change:
    """What opened or closed at one slot: which feature, its value, the band it left."""

    slot: int
    feature: Feature
    opened: bool
    value: float
    low: float
    high: float

    @property
    def kind(self) -> str:
        """The feature's word for the side it left to."""
        return self.feature.below if self.value < self.low else self.feature.above


class Lasting:
    """All features of all slots. Feed each second's cells; changes come back."""

    def __init__(self, config: LastingConfig = LastingConfig()) -> None:
        self.config = config
        self.ranges = tuple(Ranges(config.rule(feature)) for feature in FEATURES)
        zero, scales = np.float64(0), np.zeros(4)
        self.columns = Columns(
            count=np.zeros(4, np.int32), total=scales, square=scales, pivot=scales, crossings=np.int32(0),
            side=np.int8(0), before=np.float64(np.nan), before_s=np.float64(np.nan), base=zero, jump=zero,
            wait=np.int32(0), low=zero, high=zero,
        )  # fmt: skip

    def grow(self, rows: int) -> None:
        """Have that many slots."""
        self.columns.grow(rows)
        for ranges in self.ranges:
            ranges.columns.grow(rows)

    def reset(self, slots: Ints) -> None:
        """These slots are new."""
        self.columns.reset(slots)
        for ranges in self.ranges:
            ranges.columns.reset(slots)

    def expect(self, slot: int, *, least: float) -> None:
        """Changes of a slot's values below `least` are none."""
        for feature, ranges in zip(FEATURES, self.ranges, strict=True):
            if not feature.name.endswith("crossings"):
                ranges.columns["least"][slot] = least / (2.0 if feature.name.endswith("spread") else 1.0)

    def seen(self, slot: int) -> tuple[int, int]:
        """Seconds learnt, and how many are needed."""
        return min(int(self.ranges[0].columns["seen"][slot]), self.config.learn_s), self.config.learn_s

    def band(self, slot: int) -> tuple[float, float]:
        """Where a second's mean is expected."""
        low, high = self.ranges[0].band(np.array([slot]))
        return float(low[0]), float(high[0])

    def accept(self, slot: int, kind: str, value: float) -> None:
        """What was told of this kind is normal; `value` is the series' own where the kind is one of `OF_VALUE`."""
        for feature, ranges in zip(FEATURES, self.ranges, strict=True):
            if kind in (feature.above, feature.below):
                ranges.accept_told(slot)
            if kind in OF_VALUE and feature.name.endswith("mean"):
                ranges.accept(slot, value)
        if kind == "step":
            self.ranges[_NUMBER["second.jump"]].accept(slot, float(self.columns["jump"][slot]))

    def feed(self, second: Second) -> list[Change]:
        """Judge one second of some slots."""
        changes: list[Change] = []
        self._evaluate("second.mean", second.slots, second.mean, changes)
        many = second.count >= 4.0
        if many.any():
            self._evaluate("second.spread", second.slots[many], second.spread[many], changes)
        self._jump(second, changes)
        self._cross(second)
        for scale in (1, 2, 3):
            self._gather(scale, second.slots, second.mean, changes)
        return changes

    def dump(self) -> dict[str, Mapping[str, npt.NDArray[Any]]]:
        """All state as groups of arrays."""
        parts: dict[str, Mapping[str, npt.NDArray[Any]]] = {"lasting": self.columns.dump()}
        for feature, ranges in zip(FEATURES, self.ranges, strict=True):
            parts[f"lasting.{feature.name}"] = ranges.columns.dump()
        return parts

    def load(self, parts: Mapping[str, Mapping[str, npt.NDArray[Any]]]) -> None:
        """Take over what `dump` gave. Raises ValueError and KeyError."""
        self.columns.load(parts["lasting"])
        for feature, ranges in zip(FEATURES, self.ranges, strict=True):
            ranges.columns.load(parts[f"lasting.{feature.name}"])

    def _evaluate(self, name: str, slots: Ints, x: Floats, changes: list[Change]) -> None:
        number = _NUMBER[name]
        self._collect(number, slots, x, self.ranges[number].evaluate(slots, x), changes)

    @staticmethod
    def _collect(number: int, slots: Ints, x: Floats, verdict: Verdict, changes: list[Change]) -> None:
        for place in np.flatnonzero(verdict.opened | verdict.closed).tolist():
            low, high = float(verdict.low[place]), float(verdict.high[place])
            opened = bool(verdict.opened[place])
            changes.append(Change(int(slots[place]), FEATURES[number], opened, float(x[place]), low, high))

    def _gather(self, scale: int, slots: Ints, x: Floats, changes: list[Change]) -> None:
        """Add a second to the open windows of a scale; judge those that are full."""
        columns, window = self.columns, self.config.window[scale]
        count = columns["count"][slots, scale]
        pivot = np.where(count == 0, x, columns["pivot"][slots, scale])
        apart = x - pivot
        total = np.where(count == 0, 0.0, columns["total"][slots, scale]) + apart
        square = np.where(count == 0, 0.0, columns["square"][slots, scale]) + apart * apart
        full = count + 1 >= window
        columns["pivot"][slots, scale] = pivot
        columns["total"][slots, scale], columns["square"][slots, scale] = total, square
        columns["count"][slots, scale] = np.where(full, 0, count + 1)
        if not full.any():
            return
        rows, mean = slots[full], total[full] / window
        spread = np.sqrt(np.maximum(square[full] / window - mean * mean, 0.0))
        word = ("", "short", "minute", "long")[scale]
        self._evaluate(f"{word}.mean", rows, pivot[full] + mean, changes)
        self._evaluate(f"{word}.spread", rows, spread, changes)
        if scale == 2:
            self._evaluate("minute.crossings", rows, columns["crossings"][rows].astype(np.float64), changes)
            columns["crossings"][rows] = 0

    def _cross(self, second: Second) -> None:
        """Count crossings of the learnt mean, with a dead zone around it."""
        slots, learnt = second.slots, self.ranges[0].columns
        zone = self.config.crossing_deviations * np.sqrt(learnt["var"][slots])
        apart = second.mean - learnt["mean"][slots]
        side = self.columns["side"][slots]
        now = np.where(apart > zone, 1, np.where(apart < -zone, -1, side)).astype(np.int8)
        self.columns["crossings"][slots] += (now * side) < 0
        self.columns["side"][slots] = now

    def _jump(self, second: Second, changes: list[Change]) -> None:
        """A jump beyond all seen is a step when three seconds later it was not taken back."""
        columns, slots, ranges = self.columns, second.slots, self.ranges[_NUMBER["second.jump"]]
        before, passed = columns["before"][slots], second.at_s - columns["before_s"][slots]
        columns["before"][slots], columns["before_s"][slots] = second.mean, second.at_s
        wait = columns["wait"][slots]
        idle = (wait == 0) & (passed > 0.0) & (passed <= 2.0 + 0.0 * before)
        if idle.any():
            self._leap(slots[idle], second.mean[idle] - before[idle], before[idle], ranges)
        busy = wait != 0
        if busy.any():
            self._settle(slots[busy], second.mean[busy], ranges, changes)

    def _leap(self, slots: Ints, jump: Floats, before: Floats, ranges: Ranges) -> None:
        low, high = ranges.band(slots)
        far = ((jump < low) | (jump > high)) & (ranges.columns["seen"][slots] >= ranges.rule.learn)
        near = ~far
        ranges.evaluate(slots[near], jump[near])
        if far.any():
            columns, rows = self.columns, slots[far]
            columns["base"][rows], columns["jump"][rows], columns["wait"][rows] = before[far], jump[far], 1
            columns["low"][rows], columns["high"][rows] = before[far] + low[far], before[far] + high[far]

    def _settle(self, slots: Ints, x: Floats, ranges: Ranges, changes: list[Change]) -> None:
        columns = self.columns
        jump, wait = columns["jump"][slots], columns["wait"][slots] + 1
        stays = (x - columns["base"][slots]) * np.sign(jump) > 0.5 * np.abs(jump)
        taken_back = (wait <= 4) & ~stays
        opened, closed = (wait == 4) & stays, wait >= STEP_KEPT_S
        columns["wait"][slots] = np.where(taken_back | closed, 0, wait)
        back = slots[taken_back]
        if len(back):
            ranges.evaluate(back, np.clip(jump[taken_back], *ranges.band(back)))
        verdict = Verdict(opened, closed, columns["low"][slots], columns["high"][slots])
        self._collect(_NUMBER["second.jump"], slots, x, verdict, changes)
