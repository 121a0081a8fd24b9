"""The documents of the history API, as OpenAPI describes them; a test checks that the answers fit."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = ["History", "InstantMessages", "MessagePage", "Timeline"]

Class = Literal["event", "metric", "bulk", "live"]


class Loss(Exact):
    """Samples that are not stored; `topic` null: metric rows, or not known."""

    from_ms: float
    to_ms: float
    count: int
    reason: str
    topic: str | None


class StoredTopicState(Exact):
    """What is stored of one topic under one type and class; `bytes` are those of the messages."""

    topic: str
    type: str
    class_: Class = Field(alias="class")
    samples: int
    bytes: int
    first: str
    last: str


class History(Exact):
    """What is stored of a robot; `first` and `last` are over all topics, null without any."""

    topics: list[StoredTopicState]
    series: int
    first: str | None
    last: str | None


class Timeline(Exact):
    """Messages and metric rows by bucket of `width_ms`."""

    start_ms: float
    end_ms: float
    width_ms: float
    messages: list[int]
    rows: list[int]
    gaps: list[Loss]


class MessageError(Exact):
    """Why a message is not shown as JSON."""

    code: str
    message: str


class StoredMessage(Exact):
    """One message: `message` or, as it was published, `cdr` in base64."""

    topic: str
    type: str
    stamp: str
    stamp_ms: float
    seq: int
    epoch: str
    class_: Class = Field(alias="class")
    message: dict[str, Any] | None = None
    error: MessageError | None = None
    cdr: str | None = None


class MessagePage(Exact):
    """Messages in order of their stamps; `next` is the cursor of the page after, null at the end."""

    messages: list[StoredMessage]
    gaps: list[Loss]
    next: str | None


class MissingTopic(Exact):
    """A topic without a message to show."""

    topic: str
    reason: Literal["not_stored", "too_old", "damaged", "purged", "too_large"]
    nearest_ms: float | None


class InstantMessages(Exact):
    """The newest message of each topic at an instant."""

    t_ms: float
    messages: list[StoredMessage]
    missing: list[MissingTopic]
    gaps: list[Loss]
