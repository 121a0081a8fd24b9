"""Bodies and answers of the alerts' and silences' routes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = [
    "Alert",
    "AlertAssign",
    "AlertComment",
    "AlertCounts",
    "AlertDetail",
    "AlertList",
    "AlertNormal",
    "AlertSilence",
    "AlertState",
    "AlertText",
    "Severity",
    "Silence",
    "SilenceList",
    "SilenceRequest",
]

AlertState = Literal["open", "acknowledged", "resolved"]
Severity = Literal["info", "warning", "error"]
MAX_TEXT = 2000
MAX_REASON = 500
MAX_GLOBS = 32
MAX_SILENCE_S = 365 * 86_400.0
Pattern = Annotated[str, Field(min_length=1, max_length=128)]


class Alert(Exact):
    """What is wrong with a robot; one is not resolved for each robot and `cause`. Robot "" is the fleet itself.

    `reason`, `series`, `detector`, `score` (0 to 1), `value` and the expected band `low` to `high` are of its worst
    finding. `first` is the robot's stamp where it began, and `path` the robot's page at that time; the other times are
    the gateway's. `clearing` is since when nothing is wrong any more, before it is resolved. `quiet`: nobody is told of
    it, because of the alert `inhibited_by` that explains it, or a `silence`. `clip` is the recording of its evidence.
    """

    id: str
    robot: str
    cause: str
    state: AlertState
    severity: Severity
    title: str
    reason: str
    series: str
    detector: str
    score: float
    value: float | None
    low: float | None
    high: float | None
    opened: str
    first: str
    changed: str
    seen: str
    clearing: str | None
    resolved: str | None
    resolved_by: str
    acknowledged: str | None
    acknowledged_by: str
    assignee: str
    times: int
    clip: str
    inhibited_by: str
    silence: str
    quiet: bool
    gateway: str
    revision: int
    path: str


class AlertFinding(Exact):
    """One thing that is wrong at one place; `series` is a metric, topic, node or stream, "" the whole robot."""

    detector: str
    series: str
    severity: Severity
    score: float
    value: float | None
    low: float | None
    high: float | None
    reason: str
    at: str
    active: bool


class AlertRemark(Exact):
    """What somebody said or did; `by` is empty where the gateway did it."""

    number: int
    at: str
    by: str
    kind: str
    text: str


class AlertDetail(Alert):
    """With its findings, the worst first, and its remarks, the oldest first."""

    findings: list[AlertFinding]
    remarks: list[AlertRemark]


class AlertList(Exact):
    """The newest first; `next` is the `before` of the next page, null at the end."""

    alerts: list[Alert]
    next: str | None


class AlertCounts(Exact):
    """Alerts that are not resolved, of robots in one's scope; `quiet` ones, of which nobody is told, count beside."""

    open: int
    acknowledged: int
    error: int
    warning: int
    info: int
    quiet: int


class AlertText(Exact):
    """What somebody says with it."""

    text: str = Field(default="", max_length=MAX_TEXT)


class AlertComment(Exact):
    """A comment."""

    text: str = Field(min_length=1, max_length=MAX_TEXT)


class AlertAssign(Exact):
    """Who sees to it; "" is nobody."""

    assignee: str = Field(max_length=128)


class AlertSilence(Exact):
    """For how long nobody is told of this robot's alerts of this cause."""

    for_s: float = Field(default=3600.0, ge=1.0, le=MAX_SILENCE_S, allow_inf_nan=False)
    reason: str = Field(default="", max_length=MAX_REASON)


class AlertNormal(Exact):
    """The alert, and what was taught."""

    alert: Alert
    taught: list[str]


class Silence(Exact):
    """Nobody is told of alerts that match; empty `robots` and `causes` (patterns) match all.

    `up_to` is the highest severity that it silences: "warning" lets errors through.
    """

    id: str
    robots: list[str]
    causes: list[str]
    up_to: Severity
    from_: str = Field(alias="from")
    until: str
    by: str
    reason: str


class SilenceList(Exact):
    """Those that are not over, the newest first."""

    silences: list[Silence]
    next: str | None


class SilenceRequest(Exact):
    """A silence from now on, for `for_s`; `robots` empty is the whole fleet, which an admin may."""

    robots: list[Pattern] = Field(max_length=MAX_GLOBS)
    causes: list[Pattern] = Field(default_factory=list, max_length=MAX_GLOBS)
    up_to: Severity = "error"
    for_s: float = Field(default=3600.0, ge=1.0, le=MAX_SILENCE_S, allow_inf_nan=False)
    reason: str = Field(default="", max_length=MAX_REASON)
