"""Which alerts are quiet: another alert of the robot inhibits them, or a silence covers them, as in Alertmanager."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

from gateway.alerting.alerts.causes import explains
from gateway.domain.alert import Alert, Silence, rank

__all__ = ["Inhibitor"]

REMEMBERED = 20_000  # robots, and pairs of a silence and a cause
PATTERNS_AT_ONCE = 1000  # that are looked at before others have their turn


class Inhibitor:
    """The silences that are not over, and those of them that silence now."""

    def __init__(self, topics_of: Callable[[str, str], Collection[str]]) -> None:
        self._topics_of = topics_of
        self._silences: tuple[Silence, ...] = ()
        self._now: tuple[Silence, ...] = ()
        self._around: dict[str, tuple[Silence, ...]] = {}  # of each robot that was asked for, those that reach it
        self._means: dict[tuple[str, str], bool] = {}  # whether a silence is about a cause

    @property
    def robots_at_once(self) -> int:
        """How many robots can be held against all silences without being felt."""
        return max(1, PATTERNS_AT_ONCE // max(1, sum(len(item.robots) for item in self._now)))

    def set_silences(self, silences: Sequence[Silence]) -> None:
        """The silences that are not over."""
        self._silences = tuple(silences)

    def refresh(self, now_ns: int) -> bool:
        """Whether others silence now than at the last look."""
        before = self._now
        self._now = tuple(item for item in self._silences if item.from_ns <= now_ns < item.until_ns)
        if self._now == before:
            return False
        self._around.clear()
        self._means.clear()
        return True

    def of(self, alert: Alert, others: Iterable[Alert]) -> tuple[str, str]:
        """What explains the alert, of the robot's others that are not resolved, and what silences it; "" is nothing."""
        why = next((other.id for other in others if explains(other, alert, self._topics_of)), "")
        found = (item.id for item in self._reaching(alert.robot) if self._covers(item, alert))
        return why, next(found, "")

    def _reaching(self, robot: str) -> tuple[Silence, ...]:
        """Looked for once a robot: all silences together may have thousands of patterns."""
        found = self._around.get(robot)
        if found is None:
            if len(self._around) >= REMEMBERED:
                self._around.clear()
            found = self._around[robot] = tuple(item for item in self._now if item.reaches(robot))
        return found

    def _covers(self, silence: Silence, alert: Alert) -> bool:
        if rank(alert.severity) > rank(silence.up_to):
            return False
        key = (silence.id, alert.cause)
        means = self._means.get(key)
        if means is None:
            if len(self._means) >= REMEMBERED:
                self._means.clear()
            means = self._means[key] = silence.means(alert.cause)
        return means
