"""A rule as it was read: where its events come from, which of them count, and what they set off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gateway.automation.rules.transform import WHOLE, Transform
from gateway.domain.automation.delivery import Policy
from gateway.domain.automation.event import like
from gateway.domain.automation.rule import Maker
from metaros.automation.rules.pattern import Pattern
from metaros.automation.rules.schedule import Schedule
from metaros.automation.rules.when import When

__all__ = ["MetricSource", "Rule", "ScheduleSource", "Target", "TopicSource"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicSource:
    """Samples of a topic of some robots; `topic` is a full name, or one in any namespace, and may be a pattern."""

    topic: str
    robots: tuple[str, ...] = ("*",)


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricSource:
    """Values of a series of some robots; one counts where it is over `above` or under `below`."""

    series: str
    robots: tuple[str, ...] = ("*",)
    above: float | None = None
    below: float | None = None

    def beyond(self, value: float) -> bool:
        """Whether a value counts; one that is no number does not."""
        return (self.above is not None and value > self.above) or (self.below is not None and value < self.below)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduleSource:
    """Times; `misfire` says what becomes of those that nobody was there for: skip, once or all."""

    schedule: Schedule
    expression: str
    timezone: str = "UTC"
    misfire: str = "skip"


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """What a rule sets off. `fields` are those of its kind; `document` is all that its rule says of it."""

    id: str
    kind: str
    fields: Mapping[str, Any]
    document: Mapping[str, Any]
    transform: Transform = WHOLE
    policy: Policy = field(default_factory=Policy)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rule:
    """One rule. `token` is another one whenever what it remembers would mean something else."""

    name: str
    enabled: bool = True
    pattern: Pattern | None = None
    until: Pattern | None = None
    topic: TopicSource | None = None
    metric: MetricSource | None = None
    schedule: ScheduleSource | None = None
    when: When | None = None
    event_format: str = "eventbridge"
    targets: tuple[Target, ...] = ()
    document: Mapping[str, Any] = field(default_factory=dict)
    token: str = ""
    maker: Maker
    revision: int = 0

    def about(self, robot: str) -> bool:
        """Whether the rule may know of what is about that robot, and asks for it."""
        if not self.maker.sees(robot):
            return False
        source = self.topic or self.metric
        return source is None or any(like(robot, glob) for glob in source.robots)
