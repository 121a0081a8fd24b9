"""Every detector of a gateway over the same slots: a second of rows goes through all of them, in one order.

Slots, topics and robots are numbers of `gateway.alerting.anomaly.registry`; findings go to `FindingWriter`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from gateway.alerting.anomaly.checks import CheckTable
from gateway.alerting.anomaly.config import EvaluatorConfig
from gateway.alerting.anomaly.defaults import learning_of
from gateway.alerting.anomaly.detectors.cells import Cells, Second
from gateway.alerting.anomaly.detectors.cohort import Cohorts
from gateway.alerting.anomaly.detectors.columns import Columns, Ints
from gateway.alerting.anomaly.detectors.flat import Flat
from gateway.alerting.anomaly.detectors.lasting import OF_VALUE, Lasting
from gateway.alerting.anomaly.detectors.novelties import Novelties
from gateway.alerting.anomaly.detectors.presence import Presence
from gateway.alerting.anomaly.detectors.rates import Rates, topic_of_rate
from gateway.alerting.anomaly.detectors.values import Values
from gateway.alerting.anomaly.detectors.vector import Vectors
from gateway.alerting.anomaly.findings import FindingWriter
from gateway.alerting.anomaly.registry import RobotNames, SeriesRegistry

__all__ = ["DetectorSet"]

Parts = Mapping[str, Mapping[str, npt.NDArray[Any]]]


class DetectorSet:
    """All that learns. `cells` takes the rows in."""

    def __init__(self, config: EvaluatorConfig, names: SeriesRegistry, writer: FindingWriter) -> None:
        self._names, self._writer = names, writer
        self.cells = Cells(pending_rows=config.pending_rows)
        self.lasting = Lasting(config.lasting)
        self.novelties = Novelties(config.bank, novel_s=config.novel_s, need=config.novel_need)
        self.flat = Flat()
        self.values = Values()
        self.presence = Presence(config.presence, config.rates)
        self.rates = Rates(config.rates)
        self.vectors = Vectors(config.vector)
        self.cohorts = Cohorts(config.cohort)
        self.slots = Columns(topic=np.int64(-1), place=np.int64(-1), is_rate=np.bool_(False), learnt=np.bool_(True))

    def set_checks(self, table: CheckTable) -> None:
        """Judge by another table from now on. Thresholds are attached series by series."""
        self.rates.set_checks(table)
        self.presence.rates.set_checks(table)

    def add(self, slot: int, known: RobotNames, topic: int, *, series: str, is_rate: bool, table: CheckTable) -> None:
        """A new series of a robot; the first 64 of a robot make its vector."""
        for columns in self._by_slot():
            columns.grow(slot + 1)
        self.lasting.grow(slot + 1)
        for columns in self.presence.parts.values():
            columns.grow(topic + 1)
        for columns in self._by_robot():
            columns.grow(known.number + 1)
        self.cells.slots["robot"][slot] = known.number
        self.presence.topics["robot"][topic] = known.number
        self.slots["topic"][slot], self.slots["is_rate"][slot] = topic, is_rate
        if is_rate:
            return
        learning = learning_of(series)
        self.lasting.expect(slot, least=learning.least)
        self.slots["learnt"][slot] = learning.learnt
        self.novelties.add(slot)
        self.values.attach(slot, series, table)
        if not learning.learnt:
            return
        free = np.flatnonzero(self.vectors.columns["slots"][known.number] < 0)
        if len(free):
            self.vectors.columns["slots"][known.number, free[0]] = slot
            self.slots["place"][slot] = free[0]

    def forget(self, known: RobotNames) -> None:
        """The robot's slots, topics and number will be somebody else's."""
        slots, topics = (np.array(sorted(x.values()), np.int64) for x in (known.series, known.topics))
        self.cells.forget(slots)
        self.lasting.reset(slots)
        self.novelties.free(slots)
        for slot in slots.tolist():
            self.values.detach(slot)
        for columns in self._by_slot():
            columns.reset(slots)
        for columns in self.presence.parts.values():
            columns.reset(topics)
        for columns in self._by_robot():
            if len(columns) > known.number:
                columns.reset(known.number)

    def feed(self, second: Second, table: CheckTable) -> None:
        """Judge and learn one second."""
        at_s, slots = second.at_s, second.slots
        robots = np.unique(self.cells.slots["robot"][slots])
        silence, *speeds = self.presence.feed(second, self.slots["topic"][slots], robots)
        self._writer.silence(silence, table, at_s)
        for check_id, verdict in zip(("rate_low", "rate_high"), speeds, strict=True):
            if len(verdict.rows):
                self._writer.rate(check_id, verdict, self._names.topic_names, table, at_s)
        is_rate = self.slots["is_rate"][slots]
        if is_rate.any():
            self._feed_rates(slots[is_rate], second.last[is_rate], table, at_s)
            second = second.where(~is_rate)
        if len(second.slots):
            self._feed_metrics(second, table)
            self._feed_vectors(second, robots, table)

    def compare(self, at_s: float, table: CheckTable) -> None:
        """Robots beside robots like them, once a minute."""
        verdict = self.cohorts.evaluate(at_s)
        if verdict is not None:
            self._writer.cohort(verdict, table, at_s)

    def accept(self, slot: int, kind: str, value: float) -> None:
        """What this kind told of a series is normal."""
        if kind == "frozen":
            self.flat.accept(slot)
        elif kind == "cohort":
            self.cohorts.accept(slot)
        else:
            self.lasting.accept(slot, kind, value)
            if kind in OF_VALUE:
                self.novelties.bank.accept(int(self.novelties.columns["bank"][slot]), value)

    def accept_topic(self, topic: int, rate: int, kind: str, value: float) -> None:
        """What this kind told of a topic, or of the slot of its rate as the agent counts, is normal; -1: none."""
        if kind == "silence" and topic >= 0:
            self.presence.accept(topic)
        elif kind != "silence" and topic >= 0:
            self.presence.rates.accept(topic, value)
        if kind != "silence" and rate >= 0:
            self.rates.accept(rate, value)

    def newest_s(self, robot: int) -> float:
        """The newest second of a robot's rows."""
        return float(self.cells.robots["newest_s"][robot])

    @property
    def size_bytes(self) -> int:
        """What all arrays take."""
        sizes = (array.nbytes for group in self._arrays().values() for array in group.values())
        return sum(sizes) + self.novelties.bank.size_bytes

    def dump(self) -> dict[str, Mapping[str, npt.NDArray[Any]]]:
        """All state as groups of arrays."""
        return {**self._arrays(), **self.novelties.dump()}

    def load(self, parts: Parts, table: CheckTable) -> None:
        """Take over what `dump` gave. Raises ValueError, KeyError, TypeError and SnapshotError."""
        for name, columns in self._columns().items():
            columns.load(parts[name])
        self.cells.load(parts["cells"])
        self.cohorts.load(parts["cohorts"])
        self.values.load(parts, table)
        self.lasting.load(parts)
        self.novelties.load(parts)

    def _feed_rates(self, slots: Ints, hz: npt.NDArray[np.float64], table: CheckTable, at_s: float) -> None:
        for check_id, verdict in zip(("rate_low", "rate_high"), self.rates.feed(slots, hz, at_s), strict=True):
            if len(verdict.rows):
                names = {slot: self._names.names[slot] for slot in verdict.rows.tolist()}
                topics = {slot: (robot, topic_of_rate(series)) for slot, (robot, series, _) in names.items()}
                self._writer.rate(check_id, verdict, topics, table, at_s, source="the agent")

    def _feed_metrics(self, second: Second, table: CheckTable) -> None:
        at_s = second.at_s
        self._writer.values(self.values.feed(second), at_s)
        self._writer.flat(self.flat.feed(second), table, at_s)
        learnt = self.slots["learnt"][second.slots]
        if not learnt.all():
            second = second.where(learnt)
        if not len(second.slots):
            return
        level = self.lasting.ranges[0]
        low, high = level.columns["low"][second.slots], level.columns["high"][second.slots]
        ready = level.columns["seen"][second.slots] >= level.rule.learn
        least = level.columns["least"][second.slots]
        seen_low, seen_high = np.where(ready, low - least, -np.inf), np.where(ready, high + least, np.inf)
        novel = self.novelties.feed(second, seen_low, seen_high)
        self._writer.novel(novel, second, low, high, table)
        self._writer.lasting(self.lasting.feed(second), table, at_s)
        self.cohorts.put(second.slots, second.mean, at_s)

    def _feed_vectors(self, second: Second, robots: Ints, table: CheckTable) -> None:
        place = self.slots["place"][second.slots]
        inside = place >= 0
        slots = second.slots[inside]
        self.vectors.put(self.cells.slots["robot"][slots], place[inside], second.mean[inside], second.at_s)
        verdict = self.vectors.evaluate(robots, second.at_s)
        check = table.get("together")
        if verdict is None or check is None:
            return
        for n, robot in enumerate(verdict.robots.tolist()):
            held = self.vectors.columns["slots"][robot].tolist()
            names = [self._names.names[slot][1] if slot >= 0 else "" for slot in held]
            self._writer.together(self._names.robot_names[robot], names, verdict, n, check, second.at_s)

    def _by_slot(self) -> tuple[Columns, ...]:
        rates = self.rates.parts.values()
        return (
            self.slots, self.cells.slots, self.flat.columns, self.novelties.columns, self.cohorts.columns, *rates,
        )  # fmt: skip

    def _by_robot(self) -> tuple[Columns, ...]:
        return self.cells.robots, self.presence.robots, self.vectors.columns

    def _columns(self) -> dict[str, Columns]:
        """What is kept as it is; the others know themselves how."""
        return {
            "slots": self.slots,
            "cells.slots": self.cells.slots,
            "cells.robots": self.cells.robots,
            "flat": self.flat.columns,
            "presence.robots": self.presence.robots,
            "vectors": self.vectors.columns,
            **{f"presence.{name}": columns for name, columns in self.presence.parts.items()},
            **{f"rates.{name}": columns for name, columns in self.rates.parts.items()},
        }

    def _arrays(self) -> dict[str, Mapping[str, npt.NDArray[Any]]]:
        own = {name: columns.dump() for name, columns in self._columns().items()}
        other = {"cells": self.cells.dump(), "cohorts": self.cohorts.dump()}
        return {**own, **other, **self.values.dump(), **self.lasting.dump()}
