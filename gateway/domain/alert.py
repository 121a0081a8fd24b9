"""An alert: what is wrong with a robot, from its first finding to its end; and silences, which mute its notices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from gateway.domain.automation.event import like
from gateway.domain.finding import SEVERITIES, Finding, FindingSeverity
from gateway.domain.fleet.recording import is_recording_id, new_recording_id

__all__ = [
    "ALERT_STATES",
    "EVERY_ALERT",
    "Alert",
    "AlertFilter",
    "AlertState",
    "Evidence",
    "Remark",
    "Silence",
    "is_alert_id",
    "new_alert_id",
    "rank",
]

AlertState = Literal["open", "acknowledged", "resolved"]
ALERT_STATES: tuple[AlertState, ...] = ("open", "acknowledged", "resolved")

is_alert_id = is_recording_id  # ULIDs, both
new_alert_id = new_recording_id

_RANKS = {severity: place for place, severity in enumerate(SEVERITIES)}


def rank(severity: FindingSeverity) -> int:
    """How bad, as a number: the worse the higher."""
    return _RANKS[severity]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """A finding of an alert: when this gateway heard that it began, and that it ended (0: it has not)."""

    finding: Finding
    told_ns: int
    ended_ns: int = 0

    @property
    def active(self) -> bool:
        """Whether it is still so."""
        return not self.ended_ns


@dataclass(frozen=True, slots=True, kw_only=True)
class Alert:
    """One alert as the store has it. Times are ns since the epoch, by the gateway's clock but for `first_ns`.

    Robot and cause name it: there is one that is not resolved for each pair; robot "" is the fleet. `first_ns` is the
    stamp, by the robot's clock, of the sample that opened it: where its page on the robot's time bar is. `findings` are
    what it groups, the newest state of each: those that are still so first, the worst of them first, at most
    `alert_findings`. `series`, `detector`, `score`, `value`, `low`, `high` and `reason` are of the worst.
    `inhibited_by` is the alert of the same robot that explains it ("" where none does), `silence` the silence that
    keeps it quiet: now, or when it was resolved.
    """

    id: str
    robot: str
    cause: str
    state: AlertState
    severity: FindingSeverity
    title: str
    reason: str = ""
    series: str = ""
    detector: str = ""
    score: float = 1.0
    value: float | None = None
    low: float | None = None
    high: float | None = None
    findings: tuple[Evidence, ...] = ()
    opened_ns: int
    first_ns: int
    changed_ns: int
    seen_ns: int  # when a finding last began or was told again
    clear_ns: int = 0  # since when all its findings are over; 0 while one is not
    resolved_ns: int = 0
    resolved_by: str = ""  # "" where it resolved by itself
    acknowledged_ns: int = 0
    acknowledged_by: str = ""
    assignee: str = ""
    times: int = 1  # how often it began: again while it was not resolved, or within its cool-down
    clip: str = ""  # the recording of its evidence
    inhibited_by: str = ""
    silence: str = ""
    gateway: str = ""
    revision: int = 0  # how often it was stored

    @property
    def unresolved(self) -> bool:
        """Whether it is not over."""
        return self.state != "resolved"

    @property
    def quiet(self) -> bool:
        """Whether nobody is told of it."""
        return bool(self.inhibited_by or self.silence)


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertFilter:
    """Which alerts somebody wants, and which they may have; an empty field is all of them.

    `robots` are ids, `causes` globs, `text` is looked for in title, reason, robot and cause, without regard to case.
    `from_ns` to `until_ns` are alerts that were not resolved at some time in between. `sees` says which robots are in
    scope (None: all, and the fleet's own alerts, whose robot is "").
    """

    states: tuple[AlertState, ...] = ()
    severities: tuple[FindingSeverity, ...] = ()
    robots: tuple[str, ...] = ()
    causes: tuple[str, ...] = ()
    text: str = ""
    from_ns: int = 0
    until_ns: int = 0
    quiet: bool | None = None
    sees: Callable[[str], bool] | None = field(default=None, compare=False)

    def matches(self, alert: Alert) -> bool:
        """Whether the alert is one of those."""
        return (
            (not self.states or alert.state in self.states)
            and (not self.severities or alert.severity in self.severities)
            and (not self.robots or alert.robot in self.robots)
            and (not self.causes or any(like(alert.cause, cause) for cause in self.causes))
            and (not self.from_ns or not alert.resolved_ns or alert.resolved_ns >= self.from_ns)
            and (not self.until_ns or alert.opened_ns < self.until_ns)
            and (self.quiet is None or alert.quiet == self.quiet)
            and (self.sees is None or self.sees(alert.robot))
            and self._says(alert)
        )

    def _says(self, alert: Alert) -> bool:
        text = self.text.casefold()
        places = (alert.title, alert.reason, alert.robot, alert.cause)
        return not text or any(text in place.casefold() for place in places)


EVERY_ALERT = AlertFilter()


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """What somebody said or did about an alert.

    `kind` is comment, acknowledged, unacknowledged, resolved, assigned, normal or clip; the first of an alert is 1.
    """

    alert: str
    number: int
    at_ns: int
    by: str
    kind: str
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Silence:
    """Alerts that match nobody is told of until it ends. Empty fields match everything; `robots`, `causes` are globs.

    `up_to` is up to which severity it silences: "warning" lets errors through.
    """

    id: str
    robots: tuple[str, ...] = ()
    causes: tuple[str, ...] = ()
    up_to: FindingSeverity = "error"
    from_ns: int
    until_ns: int
    by: str
    reason: str = ""

    def covers(self, alert: Alert) -> bool:
        """Whether it is about that alert, now or at another time."""
        return rank(alert.severity) <= rank(self.up_to) and self.reaches(alert.robot) and self.means(alert.cause)

    def reaches(self, robot: str) -> bool:
        """Whether it is about a robot."""
        return not self.robots or any(like(robot, glob) for glob in self.robots)

    def means(self, cause: str) -> bool:
        """Whether it is about a cause."""
        return not self.causes or any(like(cause, glob) for glob in self.causes)
