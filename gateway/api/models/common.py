"""The API's documents as models: they check request bodies and describe the answers in OpenAPI.

Answers are written by `views.py` and orjson without passing through these; a test checks that both agree.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from gateway.api.models.base import Exact
from metaros.limits import LIMITS

__all__ = [
    "CallRequest",
    "CallResult",
    "GapList",
    "Health",
    "MetricRange",
    "Ok",
    "Problem",
    "PublishRequest",
    "Ready",
    "Robot",
    "RobotList",
    "SeriesList",
    "TopicList",
    "Uplink",
    "UplinkRequest",
]


def whole(value: Any) -> Any:
    """JSON knows one kind of number: 5.0 is the integer 5."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


class Problem(Exact):
    """An error, RFC 9457; `code` is stable and listed in docs/reference/errors.md.

    `holder` is who drives, with the code lease_taken; `retry_after_s` comes with the status 429,
    `path` where a part of a document is wrong, and says which.
    """

    type: str
    title: str
    status: int
    code: str
    detail: str
    holder: str | None = None
    retry_after_s: float | None = None
    path: str | None = None


class Health(Exact):
    """The process answers."""

    status: Literal["ok"]


class Ready(Exact):
    """Whether the gateway can do its work, check by check: "ok" or what is wrong."""

    status: Literal["ready", "not ready"]
    checks: dict[str, str]
    notes: dict[str, str]  # what fails without harm to who connects


class ClassDepth(Exact):
    """How much of a class waits on the robot: accepted while the link was up (fresh) or down (backfill)."""

    name: str
    fresh_bytes: int
    backfill_bytes: int
    samples: int
    lost: int
    disk_bytes: int
    quota_bytes: int


class BlackBox(Exact):
    """What the robot still has of its last minutes, by its clock; `lost` messages did not reach its disk."""

    from_: str | None = Field(alias="from")
    to: str | None
    size_bytes: int
    quota_bytes: int
    lost: int


class Link(Exact):
    """The agent's connection. From `transport` on it is what the agent said last."""

    session: int
    rtt_ms: float | None
    outbox_bytes: int
    outbox_samples: int
    bytes_per_s: float
    transport: str
    gateway: str
    budget_bytes_per_s: int | None
    sent_bytes_per_s: float
    reconnects: int
    classes: list[ClassDepth]
    disk_free_bytes: int
    clock_offset_ms: float
    forks: int
    epochs: int
    black_box: BlackBox | None


class Counts(Exact):
    """What arrived since this gateway started; `lost` samples were declared by gaps.

    Of a robot that sends more than its quota `over_quota` live samples were dropped; `put_off`: how often it was told
    to send the others later.
    """

    samples: int
    bytes: int
    duplicates: int
    gaps: int
    lost: int
    over_quota: int
    put_off: int


class LeaseState(Exact):
    """Who drives."""

    holder: str
    expires_in_s: float


class Value(Exact):
    """A series' newest row."""

    stamp_ms: float
    value: float | None


class RobotAlerts(Exact):
    """A robot's alerts that are not resolved and not quiet; `error` and `warning` are some of the `open` ones."""

    open: int
    error: int
    warning: int


class Robot(Exact):
    """One robot; `latest` holds at most 64 series."""

    id: str
    namespace: str
    hostname: str
    state: Literal["online", "offline"]
    since: str
    last_seen: str
    agent_version: str
    labels: dict[str, str]
    link: Link
    channels: int
    counts: Counts
    lease: LeaseState | None
    latest: dict[str, Value]
    alerts: RobotAlerts


class RobotList(Exact):
    """A page of the robots that ever connected; `next` is the `after` of the page behind it."""

    robots: list[Robot]
    next: str | None


class Topic(Exact):
    """One topic; rates, messages, dropped, publishers and subscribers are the agent's, the rest the gateway's."""

    channel: int
    topic: str
    type: str
    type_hash: str
    encoding: str
    class_: Literal["event", "metric", "bulk", "live"] = Field(alias="class")
    forward: bool
    qos: str
    rate_hz: float
    bytes_per_s: float
    messages: int
    dropped: int
    thinned: int
    publishers: int
    subscribers: int
    received: int
    received_bytes: int
    lost: int
    last_stamp_ms: float | None
    demand_hz: float | None
    history_hz: float


class TopicList(Exact):
    """What the robot announced."""

    topics: list[Topic]
    next: str | None


class SeriesState(Exact):
    """One stored series."""

    name: str
    topic: str
    field: str
    samples: int
    latest: Value | None


class SeriesList(Exact):
    """The robot's series by name."""

    series: list[SeriesState]
    next: str | None


class SeriesPiece(Exact):
    """Columns; rows as they are have count 1, buckets more."""

    name: str
    stamp_ms: list[float]
    mean: list[float]
    min: list[float]
    max: list[float]
    count: list[int]


class MetricRange(Exact):
    """The asked pieces in the asked order, and what is missing of the robot's metric rows in this time.

    A gap is [from_ms, to_ms, how many rows, reason].
    """

    series: list[SeriesPiece]
    gaps: list[tuple[float, float, int, str]]


class DeclaredGap(Exact):
    """A declared loss: the numbers `from` to `to` of a stream were accepted, or given, and are stored nowhere."""

    topic: str | None
    class_: Literal["event", "metric", "bulk", "live"] | None = Field(alias="class")
    stream: int
    backfill: bool
    epoch: str
    from_: int = Field(alias="from")
    to: int
    count: int
    reason: str
    lost_from: str | None
    lost_to: str | None
    declared: str


class GapList(Exact):
    """The newest declared losses, newest first."""

    gaps: list[DeclaredGap]


class Uplink(Exact):
    """What may leave the robot and what does; `bytes_per_s` null is no limit."""

    bytes_per_s: int | None
    sent_bytes_per_s: float


class UplinkRequest(Exact):
    """Another limit; null is none."""

    bytes_per_s: Annotated[int | None, BeforeValidator(whole)] = Field(ge=LIMITS.uplink_least_bytes_per_s, le=1 << 40)


class PublishRequest(Exact):
    """Publish once. `type` may be left out when the robot announces the topic."""

    topic: str
    type: str = ""
    message: dict[str, Any] = Field(default_factory=dict)
    lease_id: str = ""
    sent_ns: int = Field(default=0, ge=0, lt=2**63)  # the client's wall clock; 0 = now


class CallRequest(Exact):
    """Call a service."""

    service: str
    type: str = ""  # as the robot's graph says
    request: dict[str, Any] = Field(default_factory=dict)
    timeout_s: float = LIMITS.command_timeout_s
    lease_id: str = ""  # of services that move the robot
    sent_ns: int = Field(default=0, ge=0, lt=2**63)


class Ok(Exact):
    """Done."""

    ok: Literal[True]


class CallResult(Exact):
    """The service's response."""

    response: dict[str, Any]
