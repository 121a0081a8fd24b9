"""A gateway event: a CloudEvents 1.0 event that rules match and functions get, as it is stored and delivered.

It comes from a topic, a metric, a schedule, a webhook, a user or the journal. The database and REST say `happening`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import orjson

from gateway.domain.automation.event import Event

__all__ = [
    "JOURNAL",
    "METRIC",
    "SCHEDULE",
    "TOPIC",
    "WEBHOOK",
    "GatewayEvent",
    "Replay",
    "Span",
    "from_journal",
]

TOPIC = "metaros.topic.message"
METRIC = "metaros.metric.threshold"
SCHEDULE = "metaros.schedule"
WEBHOOK = "metaros.webhook"
JOURNAL = "metaros"  # the source of what the journal of events has, and what every type of ours begins with


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayEvent:
    """One CloudEvents 1.0 event.

    `id` is unique for ever within `source`: handlers are idempotent by it. `type` is `metaros.` and a kind of the
    journal, one of the four above, or what a user put. `robot` is "" for what is about no single robot. `at_ns` is
    when it happened, ns since the epoch. `data` is a JSON object.
    """

    id: str
    type: str
    source: str
    at_ns: int
    robot: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Events from a time up to another (exclusive); none of `types` is all, `robots` are those in scope (None: all,
    and what is about no robot).
    """

    from_ns: int
    to_ns: int
    types: tuple[str, ...] = ()
    robots: frozenset[str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """Events that are delivered once more, and how far that is.

    `spec` (JSON) is what its maker needs to know which of the span, and whereto, after a restart. `read` were looked
    at, `put` became deliveries. `ended_ns` is 0 while it goes on; `code` says why it ended early.
    """

    id: str
    span: Span
    spec: Mapping[str, Any] = field(default_factory=dict)
    made_ns: int = 0
    read: int = 0
    put: int = 0
    ended_ns: int = 0
    code: str = ""


def from_journal(event: Event) -> GatewayEvent:
    """An event of the journal as it goes to rules and functions."""
    return GatewayEvent(
        id=f"e-{event.seq}",
        type=f"{JOURNAL}.{event.kind}",
        source=JOURNAL,
        at_ns=event.at_ns,
        robot=event.robot,
        data=orjson.loads(event.data),
    )
