"""The demand for video beside its rates: how many viewers there are, and key-frame requests. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

__all__ = ["VideoDemand"]

APART_S: Final = 0.25  # between two key frames that a robot is asked for of one topic

State = dict[str, tuple[int, int]]  # by topic: viewers, and a number that is another one for another key frame


class VideoDemand:
    """By robot and topic. Key frames that are asked for too soon after another are asked for a little later."""

    def __init__(self) -> None:
        self._wanted: dict[str, set[str]] = {}
        self._numbers: dict[str, dict[str, tuple[int, float]]] = {}  # of the last key frame, and when it was asked for
        self._sent: dict[str, State] = {}

    def want_key(self, robot: str, topic: str) -> None:
        """Somebody needs a key frame of a topic that the robot has."""
        self._wanted.setdefault(robot, set()).add(topic)

    def forget(self, robot: str) -> None:
        """The robot's link is new or gone: nothing was sent on it, and it begins with key frames by itself."""
        for known in (self._wanted, self._numbers, self._sent):
            known.pop(robot, None)

    def waiting(self) -> set[str]:
        """Robots with a key-frame request that was not sent yet."""
        return set(self._wanted)

    def due(self, robot: str, viewers: Mapping[str, int], *, now_s: float) -> State | None:
        """What to send of the video topics that somebody looks at; None when nothing changed."""
        numbers, wanted = self._numbers.setdefault(robot, {}), self._wanted.get(robot, set())
        for topic in sorted(wanted):
            number, asked_s = numbers.get(topic, (0, float("-inf")))
            if topic not in viewers:
                wanted.discard(topic)  # who begins to look gets a key frame anyway
            elif now_s - asked_s >= APART_S:
                numbers[topic] = number + 1, now_s
                wanted.discard(topic)
        if not wanted:
            self._wanted.pop(robot, None)
        state = {topic: (count, numbers.get(topic, (0, 0.0))[0]) for topic, count in viewers.items()}
        if state == self._sent.get(robot, {}):
            return None
        self._sent[robot] = state
        return state

    def sent(self, robot: str) -> State:
        """What was sent to the robot last."""
        return self._sent.get(robot, {})
