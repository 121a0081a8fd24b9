"""The evaluator of a gateway's robots: rows and facts in, findings that open and clear out.

Rows become cells of one second (`cells`), and each second goes through every detector (`detectors`); what is no
metric goes through `facts`. Nothing here reads a clock, draws a number or does any input or output: the same calls
give the same findings, also across `dump` and `load`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np

from gateway.alerting.anomaly.checks import Check, CheckTable
from gateway.alerting.anomaly.config import EvaluatorConfig
from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.anomaly.detectors.bank import Learned, SnapshotError
from gateway.alerting.anomaly.detectors.columns import Floats, Ints, Parts, pack, unpack
from gateway.alerting.anomaly.detectors.detector_set import DetectorSet
from gateway.alerting.anomaly.detectors.lasting import OF_VALUE
from gateway.alerting.anomaly.detectors.rates import RATE_SERIES, rate_series
from gateway.alerting.anomaly.detectors.robot_state import pack_robot, put_robot, take_robot, unpack_robot
from gateway.alerting.anomaly.facts import Facts
from gateway.alerting.anomaly.feedback import teaches
from gateway.alerting.anomaly.findings import FindingWriter
from gateway.alerting.anomaly.open_findings import OpenFindings
from gateway.alerting.anomaly.registry import RobotNames, SeriesRegistry
from gateway.domain.finding import Edge, Finding

__all__ = ["Evaluator", "EvaluatorConfig"]

VERSION = 1
RATE_TOPIC = "host/topics"
DEFAULT = EvaluatorConfig()
RATE_KEPT_S = 600.0  # a topic that is not named any more counts as 0 for so long
NAMED = 4096  # topics of one robot


class Evaluator:
    """See the module. Not thread-safe: one thread at a time owns it."""

    def __init__(self, config: EvaluatorConfig = DEFAULT, *, checks: Sequence[Check] = DEFAULT_CHECKS) -> None:
        self.config = config
        self.table = CheckTable(checks)
        self.refused = 0  # calls for series or robots beyond the bounds
        self._names = SeriesRegistry(slots=config.slots, robots=config.robots, slots_of_robot=config.slots_of_robot)
        self._opened = OpenFindings()
        self._writer = FindingWriter(self._names, self._opened)
        self._detectors = DetectorSet(config, self._names, self._writer)
        self._detectors.set_checks(self.table)
        self._facts = Facts(self.table)
        self._groups: dict[str, int] = {}
        self._named: dict[str, dict[str, float]] = {}
        self._at_s = -np.inf

    # --- who there is ---

    def robot(self, robot: str, cohort: str = "") -> None:
        """A robot and the word for robots like it; without one it is compared with nobody."""
        known = self._names.robot(robot)
        if known is None:
            self.refused += 1
        elif known.cohort != cohort:
            known.cohort = cohort
            for series, slot in known.series.items():
                self._detectors.cohorts.columns["group"][slot] = self._group(cohort, series)

    def slot(self, robot: str, series: str, topic: str = "") -> int:
        """The number of a series, made at first sight; -1 beyond the bounds."""
        known = self._names.robot(robot)
        slot = known.series.get(series, -1) if known is not None else -1
        if known is not None and slot < 0:
            slot = self._add(robot, known, series, topic or series)
        self.refused += slot < 0
        return slot

    def find(self, robot: str, series: str) -> int:
        """The number of a known series, else -1."""
        known = self._names.robots.get(robot)
        return known.series.get(series, -1) if known is not None else -1

    def robots(self) -> list[str]:
        """All known robots, also those without any series."""
        return sorted(self._names.robots.keys() | self._facts.robots.keys())

    def series(self, robot: str) -> list[tuple[str, int]]:
        """Names and slots of a robot's series."""
        known = self._names.robots.get(robot)
        return sorted(known.series.items()) if known is not None else []

    def forget(self, robot: str) -> None:
        """Nothing is known of the robot any more, and nobody is told."""
        self._facts.robots.pop(robot, None)
        self._named.pop(robot, None)
        self._opened.forget(robot)
        known = self._names.forget(robot)
        if known is not None:
            self._detectors.forget(known)

    def set_checks(self, checks: Sequence[Check]) -> None:
        """Another table. What is open of limits that changed is over, and opens again where it still is so; what is
        open of other rows goes on with their new severity, unless they are off.
        """
        old, self.table = self.table, CheckTable(checks)
        self._facts.table = self.table
        self._detectors.set_checks(self.table)
        changed = {row.id: self.table.get(row.id) for row in old.rows if self.table.get(row.id) != old.get(row.id)}
        over = [name for name, row in changed.items() if row is None or row.kind in ("threshold", "change")]
        for robot in self._opened.robots():
            self._opened.clear(robot, over, at_s=self._at_s)
            self._opened.grade(robot, {row.id: row.severity for row in changed.values() if row}, at_s=self._at_s)
        for known in self._names.robots.values():
            for series, slot in known.series.items():
                if not series.startswith(RATE_SERIES):
                    self._detectors.values.attach(slot, series, self.table)

    # --- what happens ---

    def samples(self, slots: Ints, stamps_s: Floats, values: Floats) -> None:
        """Rows of any slots in any order, which are copied; they are judged by the next `tick`."""
        self._detectors.cells.add(
            np.array(slots, np.int64), np.array(stamps_s, np.float64), np.array(values, np.float64)
        )

    def rates(self, robot: str, rates: Mapping[str, float], stamp_s: float) -> None:
        """The rates of a robot's topics; one that is not named any more counts as 0 for ten minutes."""
        named = self._named.setdefault(robot, {})
        fresh = islice((topic for topic in rates if topic not in named), max(0, NAMED - len(named)))
        named.update(dict.fromkeys([*(topic for topic in rates if topic in named), *fresh], stamp_s))
        for topic in [topic for topic, last_s in named.items() if not 0.0 <= stamp_s - last_s <= RATE_KEPT_S]:
            del named[topic]
        slots = [self.slot(robot, rate_series(topic), RATE_TOPIC) for topic in named]
        known = np.array(slots, np.int64)
        values = np.array([rates.get(topic, 0.0) for topic in named], np.float64)
        there = known >= 0
        self._detectors.cells.add(known[there], np.full(int(there.sum()), stamp_s), values[there])

    def heartbeat(self, robot: str, now_s: float) -> None:
        """A sign of life, by the gateway's clock."""
        known = self._names.robots.get(robot)
        newest_s = self._detectors.newest_s(known.number) if known is not None and known.series else -np.inf
        self._facts.heartbeat(robot, now_s, newest_s=newest_s if np.isfinite(newest_s) else None)

    def link(self, robot: str, up: bool, now_s: float) -> None:
        """The robot's link went up or down."""
        self._facts.link(robot, up=up, now_s=now_s)

    def gap(self, robot: str, stream: str, lost: int, now_s: float) -> None:
        """A gap was declared: so many samples of a stream will never come."""
        self._facts.count(robot, "sequence", stream, float(lost), now_s)

    def node(self, robot: str, node: str, state: str, now_s: float) -> None:
        """A node was "restarted", or is "quarantined"; other states say nothing."""
        check = self.table.named("crash_loop")
        if check is not None and state in ("restarted", "quarantined"):
            self._facts.count(robot, "crash_loop", node, 1.0 if state == "restarted" else check.high or 1.0, now_s)

    def accept(self, robot: str, series: str, kind: str, value: float) -> None:
        """ "This is normal": taught to what told such a finding, which is over. `teaching` says what is learnt."""
        known, check = self._names.robots.get(robot), self.table.named(kind)
        if known is None or check is None or not np.isfinite(value) or not teaches(check):
            return
        slot, topic = known.series.get(series, -1), known.topics.get(series, -1)
        if kind == "together":
            self._detectors.vectors.accept(known.number, value)
        elif check.kind in ("silence", "rate"):
            self._detectors.accept_topic(topic, known.series.get(rate_series(series), -1), kind, value)
        elif slot >= 0:
            self._detectors.accept(slot, kind, value)
        else:
            return
        self._opened.clear(robot, OF_VALUE if kind in OF_VALUE else (kind,), at_s=self._at_s, series=series)

    def tick(self, now_s: float) -> list[Edge]:
        """Judge what came; then what is missing by `now_s`. The findings that opened or cleared."""
        for second in self._detectors.cells.seconds():
            self._detectors.feed(second, self.table)
            self._detectors.compare(second.at_s, self.table)
            self._at_s = second.at_s
        for change in self._facts.tick(now_s):
            self._writer.fact(change, now_s)
        return self._opened.take()

    # --- what is known ---

    @property
    def dropped(self) -> int:
        """Rows that did not fit into the buffer."""
        return self._detectors.cells.dropped

    @property
    def size_bytes(self) -> int:
        """What all arrays take."""
        return self._detectors.size_bytes

    def score(self, slot: int) -> float:
        """The newest novelty score of a series."""
        return float(self._detectors.novelties.columns["score"][slot])

    def band(self, slot: int) -> tuple[float, float]:
        """Where the series' mean over a second is expected."""
        return self._detectors.lasting.band(slot)

    def learned(self, slot: int) -> Learned:
        """Seconds learnt, and of how many."""
        return Learned(*self._detectors.lasting.seen(slot))

    def open(self, robot: str | None = None) -> list[Finding]:
        """What is open now."""
        return self._opened.all(robot)

    # --- across gateways ---

    def dump_robot(self, robot: str) -> bytes:
        """Everything of one robot but rows of seconds that are not over; call it between ticks."""
        known = self._names.robots.get(robot) or RobotNames(-1)
        topics = list(known.topics)
        words = {
            "config": repr(self.config),
            "cohort": known.cohort,
            "topics": topics,
            "series": [(series, self._names.names[slot][2]) for series, slot in known.series.items()],
            "named": self._named.get(robot, {}),
            "facts": self._facts.dump(robot),
            "opened": self._opened.dump(robot),
        }
        return pack_robot(words, take_robot(self._detectors, known))

    def load_robot(self, robot: str, data: bytes) -> None:
        """Go on with a robot as another evaluator had it, or this one had.

        Raises:
            SnapshotError: it is damaged, of another version or parameter set, or there is no room for its series:
                nothing is known of the robot then.
        """
        self.forget(robot)
        words, groups = unpack_robot(data)
        try:
            if words["config"] != repr(self.config):
                raise SnapshotError("the robot's state is of another parameter set")
            self._load_robot(robot, words, groups)
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            self.forget(robot)
            raise SnapshotError(f"the robot's state is damaged: {error!r}") from None
        except SnapshotError:
            self.forget(robot)
            raise

    def judged_s(self, robot: str) -> tuple[float, dict[str, float]]:
        """The newest second of a robot's rows that is known, and of each series the newest that was judged."""
        known = self._names.robots.get(robot)
        if known is None or not known.series:
            return -np.inf, {}
        done = self._detectors.cells.slots["done_s"]
        return self._detectors.newest_s(known.number), {name: float(done[slot]) for name, slot in known.series.items()}

    def waited(self, robot: str, since_s: float) -> None:
        """Nobody could hear the robot before: it has its time to come from then on."""
        self._facts.waited(robot, since_s)

    def _load_robot(self, robot: str, words: dict[str, Any], groups: Parts) -> None:
        self.robot(robot, words["cohort"])
        for series, topic in words["series"]:
            if self.slot(robot, series, topic) < 0:
                raise SnapshotError("there is no room for the robot's series")
        known = self._names.robots.get(robot)
        if known is None or list(known.topics) != words["topics"]:
            raise SnapshotError("the robot's topics are others")
        put_robot(self._detectors, known, groups)
        rate_topic = known.topics.get(RATE_TOPIC, -1)
        if rate_topic >= 0:  # rates are not stored: that they are missing for a while is no silence
            first_s = self._detectors.presence.topics["first_s"]
            first_s[rate_topic] = max(float(first_s[rate_topic]), self._detectors.newest_s(known.number))
        self._named[robot] = dict(words["named"])
        self._facts.load({name: item for name, item in words["facts"].items() if name == robot})
        self._opened.load([item for item in words["opened"] if item[0]["robot"] == robot])

    # --- across restarts ---

    def dump(self) -> bytes:
        """Everything, waiting rows included; call it between ticks."""
        words = {
            "version": VERSION,
            "config": repr(self.config),
            "refused": self.refused,
            "at_s": self._at_s,
            "names": self._names.dump(),
            "opened": self._opened.dump(),
            "facts": self._facts.dump(),
            "groups": self._groups,
            "named": self._named,
        }
        text = np.frombuffer(json.dumps(words).encode(), np.uint8)
        return pack({"judge": {"words": text}, **self._detectors.dump()})

    @classmethod
    def load(
        cls, data: bytes, config: EvaluatorConfig = DEFAULT, *, checks: Sequence[Check] = DEFAULT_CHECKS
    ) -> Evaluator:
        """An evaluator as it was.

        Raises:
            SnapshotError: it is damaged, or of another version or parameter set.
        """
        evaluator = cls(config, checks=checks)
        try:
            parts = unpack(data)
            words = json.loads(parts["judge"]["words"].tobytes())
            if words["version"] != VERSION or words["config"] != repr(config):
                raise SnapshotError("the evaluator's snapshot is of another version or parameter set")
            evaluator.refused, evaluator._at_s = words["refused"], words["at_s"]
            evaluator._names.load(words["names"])
            evaluator._opened.load(words["opened"])
            evaluator._facts.load(words["facts"])
            evaluator._groups, evaluator._named = words["groups"], words["named"]
            evaluator._detectors.load(parts, evaluator.table)
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            raise SnapshotError(f"the evaluator's snapshot is damaged: {error!r}") from None
        return evaluator

    def _add(self, robot: str, known: RobotNames, series: str, topic: str) -> int:
        slot = self._names.slot(robot, known, series, topic)
        if slot >= 0:
            number = self._names.topic(robot, known, topic)
            is_rate = series.startswith(RATE_SERIES)
            self._detectors.add(slot, known, number, series=series, is_rate=is_rate, table=self.table)
            self._detectors.cohorts.columns["group"][slot] = self._group(known.cohort, series) if not is_rate else -1
        return slot

    def _group(self, cohort: str, series: str) -> int:
        """The number of what is compared: one series within one cohort; -1 without a cohort."""
        return self._groups.setdefault(f"{cohort}\n{series}", len(self._groups)) if cohort else -1
