"""Facts about robots besides their rows, collected until the evaluator's next cycle. Pure.

A fact is a list that JSON takes, as the log has it: the name of one of `state_machine.FACTS`, then arguments.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

import orjson

from gateway.domain.fleet.twin import Reported
from metaros.limits import LIMITS

__all__ = ["Facts", "about"]

MAX_FACTS = 100_000
MAX_RATES = 500_000  # topics, of all robots together
NODE_CHARS = 256  # of a node's name: robots choose it


class Facts:
    """On the event loop; more than is bounded between two cycles is counted and left out."""

    def __init__(self, *, most: int = MAX_FACTS) -> None:
        self.skipped = 0
        self._most = most
        self._waiting: list[list[Any]] = []
        self._heartbeats: list[str] = []
        self._topics = 0
        self._cohorts: dict[str, str] = {}

    def add(self, name: str, *arguments: Any) -> None:
        """Tell one fact."""
        if len(self._waiting) >= self._most:
            self.skipped += 1
        else:
            self._waiting.append([name, *arguments])

    def heartbeat(self, robot: str) -> None:
        """A robot gives a sign of life."""
        if len(self._heartbeats) < self._most:
            self._heartbeats.append(robot)

    def rates(self, robot: str, rates: Mapping[str, float], stamp_s: float) -> None:
        """How often a robot's topics are published, as its agent counts."""
        if self._topics + len(rates) > MAX_RATES:
            self.skipped += 1
            return
        self._topics += len(rates)
        self.add("rates", robot, {topic: hz for topic, hz in rates.items() if math.isfinite(hz)}, stamp_s)

    def cohort(self, robot: str, cohort: str) -> None:
        """With whom a robot may be compared; told where that is news."""
        if self._cohorts.get(robot, "") != cohort:
            self._cohorts[robot] = cohort
            self.add("robot", robot, cohort)

    def reset(self, robot: str) -> None:
        """Another evaluator has the robot now: what was told once is told again."""
        self._cohorts.pop(robot, None)

    def forget(self, robot: str) -> None:
        """The robot is not this gateway's to judge."""
        self._cohorts.pop(robot, None)
        self.add("forget", robot)

    def report(self, before: Reported | None, after: Reported, now_s: float) -> None:
        """A robot said what it is: which of its nodes began again, were given up, or run again."""
        known = _nodes_of(before) if before is not None else {}
        for name, row in _nodes_of(after).items():
            former = known.get(name)
            for state in _states(former if isinstance(former, Mapping) else None, row):
                self.add("node", after.robot, name, state, now_s)

    def take(self, now_s: float) -> list[list[Any]]:
        """Everything since the last time, in its order."""
        taken, self._waiting = self._waiting, []
        if self._heartbeats:
            taken.append(["heard", self._heartbeats, now_s])
            self._heartbeats = []
        self._topics = 0
        return taken


def about(facts: Iterable[Sequence[Any]], robots: Collection[str]) -> Iterator[Sequence[Any]]:
    """Of some facts those that are about these robots, or about none."""
    for fact in facts:
        if fact[0] == "checks" or (fact[0] != "heard" and fact[1] in robots):
            yield fact
        elif fact[0] == "heard":
            yield ["heard", [robot for robot in fact[1] if robot in robots], fact[2]]


def _states(before: Mapping[str, Any] | None, row: Any) -> Iterator[str]:
    """What became of a node, in the evaluator's words."""
    if not isinstance(row, Mapping):
        return
    if before is not None and any(_count(row.get(name)) > _count(before.get(name)) for name in ("crashes", "restarts")):
        yield "restarted"
    given_up = row.get("quarantined") is True
    if given_up and (before is None or before.get("quarantined") is not True):
        yield "quarantined"
    if not given_up and before is not None and before.get("quarantined") is True:
        yield "running"


def _nodes_of(item: Reported) -> Mapping[str, Any]:
    """The nodes that a robot reported; none where that is no JSON of the kind."""
    try:
        found = orjson.loads(item.reported)
    except orjson.JSONDecodeError:
        return {}
    nodes = found.get("nodes") if isinstance(found, dict) else None
    if not isinstance(nodes, dict):
        return {}
    return {name: row for name, row in islice(nodes.items(), LIMITS.robot_nodes) if len(name) <= NODE_CHARS}


def _count(value: Any) -> int:
    return value if isinstance(value, int) else 0
