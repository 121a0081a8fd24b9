"""What happened in the fleet, as the API's documents."""

from __future__ import annotations

from typing import Any, Literal

from gateway.api.models.base import Exact

__all__ = ["CloudEvent", "EventList"]


class CloudEvent(Exact):
    """One event, CloudEvents 1.0. `id` is its place in the journal: the cursor behind which to go on."""

    specversion: Literal["1.0"]
    id: str
    source: str
    type: str
    subject: str | None = None
    time: str
    datacontenttype: Literal["application/json"]
    gateway: str
    data: dict[str, Any]


class EventList(Exact):
    """A page of events. `lost` is how many behind the cursor are not kept any more.

    Behind `after` the oldest come first, and `next` is always there: ask again with it. Else the newest come first,
    and `next` is the `before` of the page of older ones, null where there is none.
    """

    events: list[CloudEvent]
    next: str | None
    lost: int
