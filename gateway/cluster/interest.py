"""Topics and rates that this gateway's viewers subscribe to on remote robots, by robot. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from gateway.domain.channel import Channel
from gateway.live.demand import merge_rates
from gateway.live.subscription import TopicSubscription

__all__ = ["InterestTable"]


class InterestTable:
    """Every subscription is asked about every channel once; all classes count, as samples of any cross."""

    def __init__(self) -> None:
        self._topics: dict[str, dict[TopicSubscription, frozenset[str]]] = {}  # by robot
        self._robots: dict[TopicSubscription, set[str]] = {}

    def of(self, robot: str) -> dict[str, float]:
        """What is wanted of a robot: topic -> rate (0: every sample)."""
        rates: dict[str, list[float]] = {}
        for subscription, topics in self._topics.get(robot, {}).items():
            for topic in topics:
                rates.setdefault(topic, []).append(subscription.max_rate_hz)
        return {topic: merge_rates(some) for topic, some in rates.items()}

    def ask(self, subscription: TopicSubscription, robot: str, channels: Iterable[Channel]) -> bool:
        """Whether a subscription wants one of a robot's channels; what it wanted of them before counts no more."""
        wanted = frozenset(
            channel.topic
            for channel in channels
            if channel.forward and not channel.history and subscription.wants(channel)
        )
        known = self._topics.get(robot, {}).pop(subscription, None)
        if wanted:
            self._topics.setdefault(robot, {})[subscription] = wanted
            self._robots.setdefault(subscription, set()).add(robot)
        return bool(wanted or known)

    def drop(self, subscription: TopicSubscription) -> set[str]:
        """A subscription is over; the robots of which it wanted something."""
        robots = self._robots.pop(subscription, set())
        for robot in robots:
            wanted = self._topics.get(robot, {})
            wanted.pop(subscription, None)
            if not wanted:
                self._topics.pop(robot, None)
        return robots

    def forget(self, robot: str) -> None:
        """Nothing of a robot is wanted from elsewhere."""
        for subscription in self._topics.pop(robot, {}):
            self._robots[subscription].discard(robot)
