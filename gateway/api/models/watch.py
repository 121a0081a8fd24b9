"""Bodies and answers of what the gateway watches: checks, routes of notices, learning, bands, backtests."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from gateway.api.models.alerts import Severity
from gateway.api.models.base import Exact

__all__ = [
    "AlertCheck",
    "AlertCheckChange",
    "AlertCheckList",
    "AlertRoute",
    "AlertRouteList",
    "AlertRouteTest",
    "Backtest",
    "BacktestRequest",
    "Band",
    "Watch",
]

DAY_S = 86_400.0
MOST = 1e300  # of a bound: what every column takes
MAX_SERIES = 64
MAX_DETECTORS = 32
SeriesName = Annotated[str, Field(min_length=1, max_length=256)]
Detector = Annotated[str, Field(min_length=1, max_length=64)]
Bound = Annotated[float | None, Field(ge=-MOST, le=MOST, allow_inf_nan=False)]
Point = tuple[float, float | None, float | None, float | None, float]
Seconds = Annotated[float | None, Field(ge=0.0, le=30 * DAY_S, allow_inf_nan=False)]


class AlertCheck(Exact):
    """A check as it is now; `low` and `high` are null where it has no such bound.

    `changed` names the fields that are not as they come, `changed_by` who made the last change.
    """

    id: str
    title: str
    unit: str
    enabled: bool
    low: float | None
    high: float | None
    for_s: float
    clear_s: float
    severity: Severity
    changed: list[str]
    changed_by: str
    changed_at: str | None


class AlertCheckList(Exact):
    """The table of checks, in its order."""

    checks: list[AlertCheck]
    next: str | None


class AlertCheckChange(Exact):
    """What is to be another; what is left out stays. `low` or `high` null: it has no such bound."""

    enabled: bool | None = None
    low: Bound = None
    high: Bound = None
    for_s: Seconds = None
    clear_s: Seconds = None
    severity: Severity | None = None

    def said(self) -> dict[str, Any]:
        """The fields that were given, with their values."""
        given = self.model_dump(include=self.model_fields_set)
        return {name: value for name, value in given.items() if value is not None or name in ("low", "high")}


class AlertRoute(Exact):
    """Where notices go: `target` is a URL or HOST:PORT without what is secret; `last_error` of the newest failure."""

    name: str
    kind: Literal["webhook", "smtp"]
    target: str
    severity: Severity
    robots: list[str]
    causes: list[str]
    sent: int
    failed: int
    waiting: int
    last: str | None
    last_error: str


class AlertRouteList(Exact):
    """The routes of `--notify`, in the file's order."""

    routes: list[AlertRoute]
    next: str | None


class AlertRouteTest(Exact):
    """Whether the notice came; `status` is the answer's of a webhook, 0 where there was none, `error` what failed."""

    ok: bool
    status: int
    error: str
    took_s: float


class SeriesWatch(Exact):
    """A series: it is learned while `seen` is below `of` samples; the newest score, and what is expected now."""

    series: str
    seen: int
    of: int
    score: float
    low: float | None
    high: float | None


class Watch(Exact):
    """What is watched of a robot, by name of the series."""

    series: list[SeriesWatch]
    next: str | None


class Band(Exact):
    """A series as far as the gateway remembers what it expected: [stamp_ms, value, low, high, score], oldest first."""

    robot: str
    series: str
    points: list[Point]


class BacktestRequest(Exact):
    """What is judged again: stored rows of a robot's series (all without `series`) in a span.

    `checks` are changes of the table by the checks' ids, for this alone; `detectors` (all without) those that run.
    """

    robot: str = Field(min_length=1, max_length=64)
    series: list[SeriesName] = Field(default_factory=list, max_length=MAX_SERIES)
    from_: str = Field(default="-24h", max_length=64, alias="from")
    to: str = Field(default="now", max_length=64)
    checks: dict[str, AlertCheckChange] = Field(default_factory=dict, max_length=256)
    detectors: list[Detector] = Field(default_factory=list, max_length=MAX_DETECTORS)


class BacktestFinding(Exact):
    """What would have been found, from `at` to `until` (null: at the end still)."""

    detector: str
    series: str
    cause: str
    severity: Severity
    score: float
    value: float | None
    low: float | None
    high: float | None
    reason: str
    at: str
    until: str | None


class BacktestAlert(Exact):
    """What would have been told."""

    cause: str
    severity: Severity
    title: str
    reason: str
    first: str
    last: str | None
    findings: int


class BacktestSeries(Exact):
    """How many samples it has, and so many points of it as a plot needs, each as a band's."""

    series: str
    samples: int
    points: list[Point]


class BacktestSpan(Exact):
    """From when to when."""

    from_: str = Field(alias="from")
    to: str


class Backtest(Exact):
    """What would have fired. `cut`: there were more rows than are judged at once; this is of the first of them."""

    robot: str
    span: BacktestSpan
    samples: int
    findings: list[BacktestFinding]
    alerts: list[BacktestAlert]
    series: list[BacktestSeries]
    cut: bool
    took_s: float
