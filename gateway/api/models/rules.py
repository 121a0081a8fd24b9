"""Bodies and answers of the routes of rules, hooks and happenings."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import ConfigDict, Field

from gateway.api.models.base import Exact, Model
from metaros.limits import LIMITS

__all__ = [
    "Anything",
    "DryRunRequest",
    "DryRunResult",
    "Happening",
    "HappeningList",
    "Hook",
    "HookList",
    "HookMade",
    "HookRequest",
    "HookSecret",
    "PutHappenings",
    "Received",
    "Rule",
    "RuleChecked",
    "RuleDocument",
    "RuleHistory",
    "RuleList",
    "RulePatch",
    "Schedule",
    "ScheduleList",
    "SchedulePreview",
    "ScheduleTimes",
    "Taken",
]

Object = dict[str, Any]
Misfire = Literal["skip", "once", "all"]
Auth = Literal["signature", "bearer"]


class RuleDocument(Exact):
    """What a rule is made of; docs/reference/rules.md says what each field may hold.

    It has a `pattern`, or one of `topic`, `metric` and `schedule`, the first two of which a pattern narrows further.
    """

    name: str = Field(min_length=1, max_length=63)
    description: str = ""
    enabled: bool = True
    pattern: Object | None = None
    until: Object | None = None
    topic: Object | None = None
    metric: Object | None = None
    schedule: Object | None = None
    when: Object | None = None
    event_format: str = "eventbridge"
    targets: list[Object] = Field(default_factory=list, max_length=LIMITS.rule_targets)


class RulePatch(Model):
    """Fields of a rule's document that are to be other ones; null takes one away (JSON Merge Patch, RFC 7396)."""

    model_config = ConfigDict(extra="allow")


class Anything(Model):
    """Any JSON object."""

    model_config = ConfigDict(extra="allow")


class RuleMaker(Exact):
    """Who made it, with the role and robots of that time: more the rule may not do, or know."""

    name: str
    role: str
    robots: list[str]


class RuleStats(Exact):
    """What it did since it was made, at all gateways. `groups` are those that it remembers something of."""

    matched: int
    fired: int
    errors: int
    last_fired: str | None
    last_error: str
    last_error_at: str | None
    groups: int


class Rule(RuleDocument):
    """A rule as it is stored; URLs of webhooks are whole for who may change rules only."""

    revision: int
    changed: str
    maker: RuleMaker
    stats: RuleStats
    next_fire: str | None


class RuleList(Exact):
    """By name; `next` is the `after` of the next page, null at the end."""

    rules: list[Rule]
    next: str | None


class RuleChange(Exact):
    """One change; `what` is created, changed, enabled, disabled or deleted."""

    revision: int
    what: str
    by: str
    at: str
    document: Object


class RuleHistory(Exact):
    """The newest first; `next` is the `before` of the next page, null at the end."""

    entries: list[RuleChange]
    next: int | None


class RuleFault(Exact):
    """What is wrong, and where, like "targets[0].url"."""

    path: str
    message: str


class RuleChecked(Exact):
    """Whether a document can be a rule."""

    ok: bool
    faults: list[RuleFault]


class DryRunRequest(Exact):
    """A stored rule by `name`, or a `rule`'s document, and a time: RFC 3339, relative like -2h, or now."""

    name: str = Field(default="", max_length=63)
    rule: Object | None = None
    from_: str = Field(default="-1h", alias="from", max_length=64)
    until: str = Field(default="now", max_length=64)
    limit: int = Field(default=100, ge=1, le=LIMITS.rule_dry_firings)


class DryPayload(Exact):
    """What a target would have got."""

    id: str
    kind: str
    payload: Any


class DryFiring(Exact):
    """The rule would have fired."""

    at: str
    happening: str
    type: str
    robot: str
    group: str
    targets: list[DryPayload]


class DryRunResult(Exact):
    """`truncated`: there was more to look at, or to tell, than a dry run may; counts are then of what was looked at."""

    scanned: int
    matched: int
    fired: int
    errors: int
    error: str
    truncated: bool
    firings: list[DryFiring]


class HookSecret(Exact):
    """A secret, shown this once."""

    secret: str


class Schedule(Exact):
    """When a rule fires by itself."""

    rule: str
    expression: str
    timezone: str
    misfire: Misfire
    enabled: bool
    next: str | None
    last: str | None


class ScheduleList(Exact):
    """By rule; `next` is the `after` of the next page, null at the end."""

    schedules: list[Schedule]
    next: str | None


class SchedulePreview(Exact):
    """A schedule that somebody thinks of."""

    expression: str = Field(min_length=1, max_length=256)
    timezone: str = Field(default="UTC", max_length=64)
    count: int = Field(default=5, ge=1, le=50)


class ScheduleTimes(Exact):
    """Its next times."""

    times: list[str]


class HookRequest(Exact):
    """An endpoint for webhooks. `signature`: by Standard Webhooks; `bearer`: the secret itself in Authorization."""

    name: str = Field(min_length=1, max_length=63)
    description: str = Field(default="", max_length=500)
    auth: Auth = "signature"
    robot: str = Field(default="", max_length=64, description="whom what comes in is about; empty: nobody")


class Hook(Exact):
    """A hook without its secret; `path` is where its webhooks go, `source` and `type` are those of its happenings."""

    name: str
    description: str
    auth: Auth
    robot: str
    path: str
    source: str
    type: str
    made: str
    made_by: str
    last_used: str | None
    accepted: int
    refused: int


class HookMade(Hook):
    """With its secret, which nobody is shown again."""

    secret: str


class HookList(Exact):
    """By name; `next` is the `after` of the next page, null at the end."""

    hooks: list[Hook]
    next: str | None


class Received(Exact):
    """It is stored; `duplicate`: it had come before, and does nothing again."""

    id: str
    duplicate: bool


class PutHappening(Exact):
    """Something that happened. Its `id` makes it once only within its `source`; `time` is RFC 3339, now by default.

    `type` is of one's own: none that begins with "metaros.".
    """

    id: str = Field(default="", max_length=200)
    type: str = Field(min_length=1, max_length=128)
    source: str = Field(default="user", min_length=1, max_length=200)
    time: str = Field(default="", max_length=64)
    robot: str = Field(default="", max_length=64)
    detail: Object = Field(default_factory=dict)


class PutHappenings(Exact):
    """Happenings that are stored, and judged by the rules, all or none."""

    entries: list[PutHappening] = Field(min_length=1, max_length=LIMITS.happening_entries)


class Taken(Exact):
    """They are stored; those of known ids, `duplicates`, were before."""

    ids: list[str]
    duplicates: int


class Happening(Exact):
    """A CloudEvents 1.0 document."""

    specversion: str
    id: str
    source: str
    type: str
    time: str
    datacontenttype: str
    subject: str | None = None
    data: Any


class HappeningList(Exact):
    """The oldest first; `next` is the `after` of the next page, null at the end."""

    happenings: list[Happening]
    next: str | None
