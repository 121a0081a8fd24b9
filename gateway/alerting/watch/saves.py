"""Which robots' states are to be saved next: those with news for people at once, the others by and by. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from zlib import crc32

__all__ = ["Saves"]


class Saves:
    """A robot that changed is saved every so many seconds; robots that came at once are spread over that time."""

    def __init__(self, *, every_s: float) -> None:
        self._every_s = every_s
        self._due_s: dict[str, float] = {}
        self._changed: set[str] = set()
        self._urgent: dict[str, None] = {}  # in their order

    def begin(self, robot: str, now_s: float) -> None:
        """A robot came."""
        self._due_s[robot] = now_s + self._every_s * (crc32(robot.encode()) % 1000) / 1000.0

    def forget(self, robot: str) -> None:
        """A robot went."""
        self._due_s.pop(robot, None)
        self._changed.discard(robot)
        self._urgent.pop(robot, None)

    def changed(self, robots: Iterable[str]) -> None:
        """There is something new of these."""
        self._changed.update(robot for robot in robots if robot in self._due_s)

    def hurry(self, robots: Iterable[str]) -> None:
        """Something of these was told to people."""
        self._urgent.update((robot, None) for robot in robots if robot in self._due_s)

    def due(self, now_s: float) -> list[str]:
        """Who is to be saved, the first one first."""
        late = [robot for robot in self._changed - self._urgent.keys() if self._due_s[robot] <= now_s]
        return [*self._urgent, *sorted(late, key=lambda robot: (self._due_s[robot], robot))]

    def saved(self, robot: str, now_s: float) -> None:
        """It is in the store as it is."""
        if robot in self._due_s:
            self._changed.discard(robot)
            self._urgent.pop(robot, None)
            self._due_s[robot] = now_s + self._every_s
