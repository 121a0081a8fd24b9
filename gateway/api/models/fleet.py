"""Groups of robots, and what a robot says at this moment, as the API's documents."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from gateway.api.models.base import Exact
from gateway.api.models.common import Value
from gateway.api.models.history import MessageError

__all__ = ["Group", "GroupList", "NewestMessage", "Snapshot"]


class Group(Exact):
    """The robots that have a label of this value; `selector` names them wherever one may be given."""

    label: str
    value: str
    selector: str
    robots: int
    online: int


class GroupList(Exact):
    """Every value of every label of robots in scope, by label and value."""

    groups: list[Group]
    next: str | None


class NewestMessage(Exact):
    """A topic's newest message: heard just now, or stored. `error` says why there is no message to show."""

    topic: str
    type: str
    class_: Literal["event", "metric", "bulk", "live"] = Field(alias="class")
    seq: int
    stamp_ms: float
    source: Literal["live", "stored"]
    message: dict[str, Any] | None
    error: MessageError | None = None


class Snapshot(Exact):
    """What a robot says: `missing` topics were announced, and of them nothing came and nothing is stored."""

    robot: str
    time: str
    online: bool
    topics: list[NewestMessage]
    missing: list[str]
    metrics: dict[str, Value]
