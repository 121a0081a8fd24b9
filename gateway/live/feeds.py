"""The JSON subscriptions of a viewer, values of series and the fleet's state, and when each is due. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gateway.live.scope import RobotPattern
from metaros.idl.globs import Glob

__all__ = ["Feeds", "FleetSubscription", "MetricSubscription"]

FLEET_EVERY_S = 0.5

Values = Mapping[str, tuple[int, float]]


class MetricSubscription:
    """Newest values by robot, at most `max_rate_hz` messages a second and robot."""

    def __init__(self, number: int, robots: RobotPattern, series: Sequence[Glob], *, max_rate_hz: float) -> None:
        self.number = number
        self._robots = robots
        self._series = tuple(series)
        self._interval_s = 1.0 / max_rate_hz
        self._waiting: dict[str, dict[str, tuple[int, float]]] = {}
        self._due_s: dict[str, float] = {}
        self._wanted: dict[str, bool] = {}

    def offer(self, robot: str, values: Values) -> bool:
        """Take new values in; False when none is wanted."""
        if not self._robots.matches(robot):
            return False
        wanted = {name: value for name, value in values.items() if self._wants(name)}
        if wanted:
            self._waiting.setdefault(robot, {}).update(wanted)
        return bool(wanted)

    def take(self, now_s: float) -> list[dict[str, Any]]:
        """Messages that are due."""
        messages = []
        for robot in [robot for robot in self._waiting if self._due_s.get(robot, 0.0) <= now_s]:
            values = self._waiting.pop(robot)
            self._due_s[robot] = now_s + self._interval_s
            message = {
                "op": "metrics",
                "id": self.number,
                "robot": robot,
                "stamp_ms": max(stamp_ns for stamp_ns, _ in values.values()) / 1e6,
                "values": {name: value for name, (_, value) in values.items()},
            }
            messages.append(message)
        return messages

    def due_s(self) -> float | None:
        """When `take` will have something; None while nothing waits."""
        return min((self._due_s.get(robot, 0.0) for robot in self._waiting), default=None)

    def _wants(self, name: str) -> bool:
        wanted = self._wanted.get(name)
        if wanted is None:
            wanted = any(glob.matches(name) for glob in self._series)
            if len(self._wanted) < 65536:
                self._wanted[name] = wanted
        return wanted


class FleetSubscription:
    """All robots at first, then the changed ones, twice a second."""

    def __init__(
        self,
        number: int,
        *,
        revisions: Callable[[], Mapping[str, int]],
        describe: Callable[[str], dict[str, Any]],
    ) -> None:
        self.number = number
        self._revisions = revisions
        self._describe = describe
        self._seen: dict[str, int] | None = None
        self._due_s = 0.0

    def take(self, now_s: float) -> list[dict[str, Any]]:
        """One message when something changed and it is time."""
        if now_s < self._due_s:
            return []
        self._due_s = now_s + FLEET_EVERY_S
        revisions = dict(self._revisions())
        seen = self._seen if self._seen is not None else {}
        changed = [robot for robot, revision in revisions.items() if seen.get(robot) != revision]
        first = self._seen is None
        self._seen = revisions
        if not changed and not first:
            return []
        return [{"op": "fleet", "id": self.number, "robots": [self._describe(robot) for robot in changed]}]

    def due_s(self) -> float:
        """When to ask next."""
        return self._due_s


class Feeds:
    """The JSON subscriptions of one connection, by their numbers."""

    def __init__(self) -> None:
        self._items: dict[int, MetricSubscription | FleetSubscription] = {}

    def __len__(self) -> int:
        return len(self._items)

    @property
    def wants_values(self) -> bool:
        """Whether one of them is of values of series."""
        return any(isinstance(item, MetricSubscription) for item in self._items.values())

    def __contains__(self, number: object) -> bool:
        return number in self._items

    def add(self, subscription: MetricSubscription | FleetSubscription) -> None:
        """Start one; its number is free."""
        self._items[subscription.number] = subscription

    def remove(self, number: int) -> None:
        """End one that there is."""
        del self._items[number]

    def offer(self, robot: str, values: Values) -> bool:
        """Take new values in; whether somebody wants them."""
        wanted = False
        for item in self._items.values():
            if isinstance(item, MetricSubscription) and item.offer(robot, values):
                wanted = True
        return wanted

    def take(self, now_s: float) -> list[dict[str, Any]]:
        """Messages that are due."""
        return [message for item in self._items.values() for message in item.take(now_s)]

    def due_s(self) -> float | None:
        """When there will be something; None: not before something arrives."""
        dues = [due_s for item in self._items.values() if (due_s := item.due_s()) is not None]
        return min(dues, default=None)
