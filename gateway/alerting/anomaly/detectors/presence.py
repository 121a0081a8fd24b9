"""Is a topic still there? By the robot's own stamps: a topic is late against the other rows of its robot.

The deadline is learnt from the topic's rate and its longest pause. After a pause of the whole robot every topic has a
grace in which to come back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gateway.alerting.anomaly.detectors.cells import Second
from gateway.alerting.anomaly.detectors.columns import Bools, Columns, Floats, Ints
from gateway.alerting.anomaly.detectors.rates import RateConfig, Rates, RateVerdict

__all__ = ["Presence", "PresenceConfig", "Silence"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PresenceConfig:
    """The one parameter set. A topic is silent after `shortest_s`, ten periods, or longer than its longest pause."""

    shortest_s: float = 3.0
    periods: float = 10.0
    longest_period_s: float = 3600.0
    pause_factor: float = 1.5
    learn_s: float = 120.0
    away_s: float = 3.0  # a robot without any row for so long was away
    grace_s: float = 45.0
    pause_memory_s: float = 86400.0


@dataclass(frozen=True, slots=True)
class Silence:
    """Topics that fell silent or came back: how long they were quiet, and how long they may be."""

    topics: Ints
    opened: Bools
    quiet_s: Floats
    deadline_s: Floats


class Presence:
    """Topics and their robots, with the topics' rates."""

    def __init__(self, config: PresenceConfig, rates: RateConfig) -> None:
        self.config = config
        never, zero = np.float64(-np.inf), np.float64(0)
        self.topics = Columns(
            robot=np.int64(-1), newest_s=never, first_s=-never, pause_s=np.float64(1), seconds=np.int64(0),
            silent=np.bool_(False), got=zero,
        )  # fmt: skip
        self.robots = Columns(newest_s=never, back_s=never)
        self.rates = Rates(rates)

    @property
    def parts(self) -> dict[str, Columns]:
        """All columns with a row a topic, by name."""
        return {"topics": self.topics, **self.rates.parts}

    def feed(self, second: Second, topics: Ints, robots: Ints) -> tuple[Silence, RateVerdict, RateVerdict]:
        """Judge a second: each cell's topic, and the robots with rows in it. Silent, too slow, too often."""
        columns, at_s = self.topics, second.at_s
        columns["got"][:] = 0.0
        np.maximum.at(columns["got"], topics, second.count)
        passed = at_s - self.robots["newest_s"][robots]
        back = robots[~((passed >= 0.0) & (passed <= self.config.away_s))]
        self.robots["back_s"][back] = at_s
        self.robots["newest_s"][robots] = at_s
        here = np.zeros(len(self.robots), np.bool_)
        here[robots] = True
        owner = columns["robot"]
        rows = np.flatnonzero((owner >= 0) & here[owner] & ((columns["seconds"] > 0) | (columns["got"] > 0.0)))
        silence = self._silence(rows, at_s)
        back_s = self.robots["back_s"][columns["robot"][rows]]
        settled = (at_s - back_s > self.config.grace_s) | (columns["seconds"][rows] <= self.config.learn_s)
        pauses = (columns["got"][rows] == 0.0) & (columns["pause_s"][rows] > self.config.shortest_s)
        rows = rows[settled & ~columns["silent"][rows] & ~pauses]  # who is known for pauses is not slow in one
        return silence, *self.rates.feed(rows, columns["got"][rows], at_s)

    def deadline_s(self, rows: Ints) -> Floats:
        """How long each topic may be silent."""
        config = self.config
        usual = self.rates.columns["usual"][rows]
        period_s = np.minimum(1.0 / np.maximum(usual, 1e-6), config.longest_period_s) * (usual > 0.0)
        pause_s = config.pause_factor * self.topics["pause_s"][rows] + 1.0
        deadline: Floats = np.maximum(config.shortest_s, np.maximum(config.periods * period_s, pause_s))
        return deadline

    def accept(self, topic: int) -> None:
        """As long as this topic is silent now, it may be."""
        columns = self.topics
        quiet_s = self.robots["newest_s"][columns["robot"][topic]] - columns["newest_s"][topic]
        columns["pause_s"][topic] = max(float(columns["pause_s"][topic]), float(quiet_s))
        columns["silent"][topic] = False

    def _silence(self, rows: Ints, at_s: float) -> Silence:
        config, columns = self.config, self.topics
        got, was = columns["got"][rows] > 0.0, columns["silent"][rows]
        back_s, newest = self.robots["back_s"][columns["robot"][rows]], columns["newest_s"][rows]
        deadline, quiet = self.deadline_s(rows), at_s - newest
        away = newest < back_s
        graced = away & (at_s - back_s < config.grace_s + deadline)
        learnt = newest - columns["first_s"][rows] >= config.learn_s
        silent = ~got & ((was & ~away) | ((quiet >= deadline) & ~graced & learnt))
        columns["silent"][rows] = silent
        self._pauses(rows, got & ~was & ~away, quiet, deadline)
        fresh = got & ((columns["seconds"][rows] == 0) | (quiet < 0.0))
        columns["first_s"][rows] = np.where(fresh, at_s, columns["first_s"][rows])
        columns["newest_s"][rows] = np.where(got, at_s, newest)
        columns["seconds"][rows] += got
        edge = silent != was
        return Silence(rows[edge], silent[edge], quiet[edge], deadline[edge])

    def _pauses(self, rows: Ints, learning: Bools, quiet: Floats, deadline: Floats) -> None:
        """The longest pause between two seconds with rows, slowly forgotten; one alone does not pass two deadlines."""
        columns = self.topics
        old = columns["pause_s"][rows]
        pause = np.maximum(old + (1.0 - old) / self.config.pause_memory_s, np.clip(quiet, 0.0, 2.0 * deadline))
        columns["pause_s"][rows] = np.where(learning, pause, old)
