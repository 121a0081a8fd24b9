"""What happened in the fleet: pages of the journal, and server-sent events that go on from any place in it."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import FieldsText, read_fields
from gateway.api.models import events as models_events
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS
from gateway.api.rest.downloads import DownloadResponse
from gateway.api.rest.sse import EVENT_STREAM, HEADERS, EventPieces, server_event
from gateway.api.services import services_of
from gateway.automation.events.cloud import TYPE_PREFIX, cloud_event
from gateway.domain.automation.event import EventFilter, EventPage
from gateway.errors import InvalidRequestError

__all__ = ["router"]

MAX_LISTED = 1000
MAX_NAMED = 64
MAX_NUMBER = (1 << 63) - 1

Cursor = Annotated[int | None, Query(ge=0, le=MAX_NUMBER)]
Kind = Annotated[str, Query(max_length=1000, description="globs over types, with commas: robot.*,node.crashed")]
Robots = Annotated[str, Query(max_length=4096, description="only these robots', with commas")]

router = api_router("/api/v1/events", tags=["events"])


@router.get(
    "",
    dependencies=[require_permission("events.read")],
    responses={200: {"model": models_events.EventList, "content": {EVENT_STREAM: {}}}, **PROBLEMS},
)
async def list_events(
    request: Request,
    kind: Kind = "",
    robot: Robots = "",
    after: Cursor = None,
    before: Cursor = None,
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = 100,
    fields: FieldsText = "",
) -> Response:
    """What happened: a page as JSON; with `Accept: text/event-stream` what follows, for ever, as server-sent events.

    A stream goes on behind `Last-Event-ID` or `after`, and without either begins now. Events of robots out of scope
    do not exist; those about no robot are for who sees every robot.
    """
    journal, wanted = services_of(request).events, _wanted(request, kind, robot)
    if EVENT_STREAM not in request.headers.get("accept", ""):
        page = await journal.read(after=after, before=before, limit=limit, wanted=wanted)
        following = str(page.next) if after is not None or page.next else None
        chosen = read_fields(fields, models_events.CloudEvent)
        events = [chosen.of(cloud_event(event)) for event in page.events]
        return JsonResponse({"events": events, "next": following, "lost": page.lost})
    cursor = _last_event(request, after)
    principal = principal_of(request)
    leave = journal.enter(f"{principal.kind}:{principal.id}")
    try:
        start = cursor if cursor is not None else await journal.newest()
        pieces = EventPieces(journal.watch(after=start, wanted=wanted), _written, cursor=str(start), closed=leave)
    except BaseException:
        leave()
        raise
    return DownloadResponse(request, pieces, what="a stream of events", media_type=EVENT_STREAM, headers=HEADERS)


def _wanted(request: Request, kind: str, robot: str) -> EventFilter:
    principal = principal_of(request)
    kinds = tuple(part.strip().removeprefix(TYPE_PREFIX) for part in kind.split(",") if part.strip())
    robots = tuple(part.strip() for part in robot.split(",") if part.strip())
    if len(kinds) > MAX_NAMED or len(robots) > MAX_NAMED:
        raise InvalidRequestError(f"kind and robot name at most {MAX_NAMED} each")
    if any("\0" in part for part in robots):
        raise InvalidRequestError("robot: text has no NUL")
    sees = None if principal.sees_all else principal.sees
    return EventFilter(kinds=kinds, robots=robots, sees=sees, sees_fleet=principal.sees_all)


def _last_event(request: Request, after: int | None) -> int | None:
    """Where to go on: a browser that comes back repeats its first address, and says in a header how far it came."""
    said = request.headers.get("last-event-id", "")
    if not said:
        return after
    if not said.isascii() or not said.isdigit() or int(said) > MAX_NUMBER:
        raise InvalidRequestError("Last-Event-ID is the id of an event")
    return int(said)


def _written(page: EventPage) -> bytes:
    lost = [server_event({"count": page.lost}, name="lost")] if page.lost else []
    events = [server_event(cloud_event(event), cursor=str(event.seq)) for event in page.events]
    return b"".join([*lost, *events])
