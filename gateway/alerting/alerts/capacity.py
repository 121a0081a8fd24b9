"""The limit of unresolved alerts, of each robot and in all."""

from __future__ import annotations

from collections import Counter

from gateway.alerting.alerts.causes import TOO_MANY
from metaros.limits import Limits

__all__ = ["Capacity"]


class Capacity:
    """Counts them; the alerts that say that there is none left need none."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._open: Counter[str] = Counter()  # of each robot
        self.taken = 0

    @property
    def full(self) -> bool:
        """Whether the fleet has as many as can be."""
        return self.taken >= self._limits.alerts_unresolved

    def has(self, place: tuple[str, str]) -> bool:
        """Whether there is room for an alert of this robot and cause."""
        robot, cause = place
        return cause == TOO_MANY or (self._open[robot] < self._limits.alerts_per_robot and not self.full)

    def count(self, place: tuple[str, str], more: int) -> None:
        """So many more of them, or fewer."""
        robot, cause = place
        if cause != TOO_MANY:
            self.taken += more
            self._open[robot] += more
        if not self._open[robot]:
            del self._open[robot]
