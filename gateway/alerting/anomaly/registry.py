"""The registry of series: robots, topics and series by name, and the numbers under which detectors keep them."""

from __future__ import annotations

import bisect
from dataclasses import dataclass, field
from typing import Any

__all__ = ["NumberAllocator", "RobotNames", "SeriesRegistry"]


class NumberAllocator:
    """Allocates the least free number, so that the same calls always give the same ones."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.used = 0  # numbers ever given: the length that arrays need
        self._free: list[int] = []

    def take(self) -> int:
        """A free number, -1 where there is none."""
        if self._free:
            return self._free.pop(0)
        if self.used >= self.limit:
            return -1
        self.used += 1
        return self.used - 1

    def give(self, number: int) -> None:
        """The number is free again."""
        bisect.insort(self._free, number)

    def dump(self) -> list[Any]:
        """As JSON takes it."""
        return [self.used, self._free]

    def load(self, dumped: list[Any]) -> None:
        """Take over what `dump` gave."""
        self.used, self._free = int(dumped[0]), list(dumped[1])


@dataclass(slots=True)
class RobotNames:
    """One robot: its number, its cohort, its topics and series by name."""

    number: int
    cohort: str = ""
    topics: dict[str, int] = field(default_factory=dict)
    series: dict[str, int] = field(default_factory=dict)


class SeriesRegistry:
    """All names. `names` gives (robot, series, topic) of a slot, `topic_names` (robot, topic) of a topic's number."""

    def __init__(self, *, slots: int, robots: int, slots_of_robot: int | None = None) -> None:
        """No robot takes more than `slots_of_robot` of the slots."""
        self._of_robot = slots if slots_of_robot is None else slots_of_robot
        self.slots, self.topics, self.numbers = NumberAllocator(slots), NumberAllocator(slots), NumberAllocator(robots)
        self.robots: dict[str, RobotNames] = {}
        self.names: dict[int, tuple[str, str, str]] = {}
        self.topic_names: dict[int, tuple[str, str]] = {}
        self.robot_names: dict[int, str] = {}

    def robot(self, name: str) -> RobotNames | None:
        """The robot, made at first sight; None where there are too many."""
        known = self.robots.get(name)
        if known is not None:
            return known
        number = self.numbers.take()
        if number < 0:
            return None
        self.robot_names[number] = name
        self.robots[name] = known = RobotNames(number)
        return known

    def topic(self, robot: str, known: RobotNames, topic: str) -> int:
        """The topic's number, made at first sight; there are never more topics than series."""
        number = known.topics.get(topic, -1)
        if number < 0 and (number := self.topics.take()) >= 0:
            known.topics[topic] = number
            self.topic_names[number] = (robot, topic)
        return number

    def slot(self, robot: str, known: RobotNames, series: str, topic: str) -> int:
        """A fresh slot for a series that has none; -1 where all are taken, or the robot has its share."""
        slot = self.slots.take() if len(known.series) < self._of_robot else -1
        if slot >= 0:
            known.series[series] = slot
            self.names[slot] = (robot, series, topic)
        return slot

    def forget(self, robot: str) -> RobotNames | None:
        """Every number of the robot is free again; what it had comes back."""
        known = self.robots.pop(robot, None)
        if known is None:
            return None
        for slot in known.series.values():
            del self.names[slot]
            self.slots.give(slot)
        for number in known.topics.values():
            del self.topic_names[number]
            self.topics.give(number)
        del self.robot_names[known.number]
        self.numbers.give(known.number)
        return known

    def dump(self) -> dict[str, Any]:
        """As JSON takes it."""
        return {
            "numbers": [numbers.dump() for numbers in (self.slots, self.topics, self.numbers)],
            "robots": {
                name: [known.number, known.cohort, known.topics, known.series] for name, known in self.robots.items()
            },
            "names": [[slot, *names] for slot, names in self.names.items()],
        }

    def load(self, dumped: dict[str, Any]) -> None:
        """Take over what `dump` gave. Raises KeyError, TypeError and ValueError."""
        for numbers, item in zip((self.slots, self.topics, self.numbers), dumped["numbers"], strict=True):
            numbers.load(item)
        for name, (number, cohort, topics, series) in dumped["robots"].items():
            self.robots[name] = RobotNames(number, cohort, topics, series)
            self.robot_names[number] = name
            self.topic_names.update({topic: (name, text) for text, topic in topics.items()})
        self.names = {slot: (robot, series, topic) for slot, robot, series, topic in dumped["names"]}
