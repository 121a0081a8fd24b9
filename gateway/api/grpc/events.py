"""EventService: what happened in the fleet, from the journal that REST reads; every call is authorized."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing
from typing import Any

from gateway.api.grpc.authenticate import Call
from gateway.api.grpc.fields import FieldFaultError
from gateway.api.grpc.stream_authorization import ENDING, DrainingError, while_authorized
from gateway.automation.events.cloud import TYPE_PREFIX
from gateway.domain.automation.event import Event, EventFilter
from metaros._proto import events_pb2

__all__ = ["EventService"]

LISTED, MAX_LISTED, MAX_NAMED, MAX_NUMBER = 100, 1000, 64, (1 << 63) - 1


class EventService:
    """Each method is one call that was let in."""

    async def ListEvents(self, request: events_pb2.ListEventsRequest, call: Call) -> Any:
        """A page of them: behind a cursor, or the newest first."""
        limit = request.limit or LISTED
        if limit > MAX_LISTED:
            raise FieldFaultError("limit", f"limit is at most {MAX_LISTED}")
        after = cursor(request.after, "after") if request.HasField("after") else None
        before = cursor(request.before, "before") or None
        wanted = wanted_events(request.filter, call)
        page = await call.services.events.read(after=after, before=before, limit=limit, wanted=wanted)
        events = [event_view(event) for event in page.events]
        return events_pb2.ListEventsResponse(events=events, next=page.next, lost=page.lost)

    async def WatchEvents(self, request: events_pb2.WatchEventsRequest, call: Call) -> AsyncIterator[Any]:
        """What follows, for ever; the first reply is empty and says where it begins. TooManyError without a place."""
        journal, wanted = call.services.events, wanted_events(request.filter, call)
        start = cursor(request.after, "after") if request.HasField("after") else None
        leave = journal.enter(f"{call.principal.kind}:{call.principal.id}")
        try:
            start = await journal.newest() if start is None else start
            yield events_pb2.WatchEventsReply(next=start)
            async with while_authorized(call), aclosing(journal.watch(after=start, wanted=wanted)) as pages:
                async for page in pages:
                    events = [event_view(event) for event in page.events]
                    yield events_pb2.WatchEventsReply(events=events, next=page.next, lost=page.lost)
            raise DrainingError(ENDING)  # nothing else ends the journal
        finally:
            leave()


def event_view(event: Event) -> events_pb2.Event:
    """An event as this API shows it."""
    return events_pb2.Event(
        cursor=event.seq,
        kind=event.kind,
        robot=event.robot,
        gateway=event.gateway,
        time_ns=event.at_ns,
        data_json=event.data,
    )


def wanted_events(asked: events_pb2.EventFilter, call: Call) -> EventFilter:
    """What is asked for, of the robots in scope; FieldFaultError names what does not fit."""
    for name, named in (("filter.kinds", asked.kinds), ("filter.robots", asked.robots)):
        if len(named) > MAX_NAMED or any(len(text) > 256 or "\0" in text for text in named):
            raise FieldFaultError(name, f"{name} has at most {MAX_NAMED} texts of 256 characters, without NUL")
    principal = call.principal
    return EventFilter(
        kinds=tuple(kind.removeprefix(TYPE_PREFIX) for kind in asked.kinds),
        robots=tuple(asked.robots),
        sees=None if principal.sees_all else principal.sees,
        sees_fleet=principal.sees_all,
    )


def cursor(number: int, name: str) -> int:
    """A place in the journal."""
    if number > MAX_NUMBER:
        raise FieldFaultError(name, f"{name} is the cursor of an event")
    return number
