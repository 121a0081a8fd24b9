"""Recordings in the API's documents: what a request may hold and what answers it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = ["Recording", "RecordingList", "RecordingRequest"]


class RecordingRequest(Exact):
    """The last seconds, or from `start` to `end` by the robot's clock; without `topics` all of them."""

    last_s: float | None = Field(default=None, gt=0, le=86_400)
    start: str = ""
    end: str = "now"
    topics: list[str] = Field(default_factory=list, max_length=64)


class Recording(Exact):
    """A clip of a robot's black box. `start` to `end` was asked, `first` to `last` is what the robot had of it."""

    id: str
    robot: str
    state: Literal["requested", "cutting", "transferring", "stored", "failed"]
    start: str
    end: str
    first: str | None
    last: str | None
    topics: list[str]
    requested: str
    size_bytes: int
    received_bytes: int
    messages: int
    sha256: str | None
    code: str
    message: str
    url: str | None


class RecordingList(Exact):
    """The newest first; `next` is the `before` of the next page, null at the end."""

    recordings: list[Recording]
    next: str | None
