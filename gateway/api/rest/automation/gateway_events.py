"""Events: those that users put, and all that there were."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Annotated

import orjson
from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission, require_visible
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.models import rules as models
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.ranges import End, Start, parse_range
from gateway.api.rest.times import parse_time
from gateway.api.services import services_of
from gateway.domain.automation.gateway_event import JOURNAL, GatewayEvent, Span
from gateway.domain.automation.shapes import cloudevent
from gateway.domain.fleet.command import new_command_id
from gateway.domain.principal import Principal
from gateway.errors import ForbiddenError, InvalidRequestError
from gateway.store.automation.gateway_events import Cursor, read_gateway_events
from gateway.store.engine import StoreEngine

__all__ = ["router"]

MAX_LOOKS = 8  # at the store, for one page: of events of which somebody may see little
PAGE = 1000
Types = Annotated[list[str] | None, Query(alias="type", max_length=64, description="only of these types")]
Count = Annotated[int, Query(ge=1, le=PAGE)]
After = Annotated[str, Query(max_length=80, description="the `next` of the page before")]

router = api_router("/api/v1/happenings", tags=["rules"])


@router.post(
    "",
    status_code=202,
    dependencies=[require_permission("happenings.put")],
    responses={202: {"model": models.Taken}, **PROBLEMS},
    openapi_extra=body_document(models.PutHappenings),
)
async def put_happenings(request: Request) -> Response:
    """Something happened: it is stored, judged by the rules and in the queue when this is answered. All or none."""
    body = await read_body(request, models.PutHappenings)
    services, principal = services_of(request), principal_of(request)
    now_ns = services.clock.wall_ns()
    made = [_made(request, principal, entry, place, now_ns) for place, entry in enumerate(body.entries)]
    for place, one in enumerate(made):
        try:
            orjson.dumps(dict(one.data))
        except TypeError as error:  # its reader takes longer numbers than its writer does
            raise InvalidRequestError(f"entries.{place}.detail: JSON with whole numbers of 64 bits: {error}") from error
    new = await services.rules.intake.accept(made)
    note(request, detail=f"{len(made)} events, {new} new")
    return JsonResponse({"ids": [one.id for one in made], "duplicates": len(made) - new}, status_code=202)


@router.get(
    "",
    dependencies=[require_permission("happenings.read")],
    responses={200: {"model": models.HappeningList}, **PROBLEMS},
)
async def list_happenings(
    request: Request,
    start: Start = "-1h",
    end: End = "now",
    types: Types = None,
    source: Annotated[str, Query(max_length=200, description="only of this source")] = "",
    robot: Annotated[str, Query(max_length=64, description="only of this robot")] = "",
    limit: Count = 100,
    after: After = "",
) -> Response:
    """What happened between two times, of robots in one's scope, the oldest first; events of the journal too."""
    services, principal = services_of(request), principal_of(request)
    from_ns, to_ns = parse_range(start, end, now_ns=services.clock.wall_ns())
    robots = frozenset((robot,)) if robot else None
    span = Span(from_ns=from_ns, to_ns=to_ns, types=tuple(types or ()), robots=robots)
    cursor = _cursor(after) if after else None
    kept: list[GatewayEvent] = []
    for _ in range(MAX_LOOKS):
        page = await services.store.read(partial(_read, span=span, cursor=cursor))
        for at, gateway_event in page:
            if _sees(principal, gateway_event) and (not source or gateway_event.source == source):
                kept.append(gateway_event)
            cursor = at
            if len(kept) == limit:
                return await _page(kept, cursor)
        if len(page) < PAGE:
            return await _page(kept, None)
    return await _page(kept, cursor)


def _read(engine: StoreEngine, *, span: Span, cursor: Cursor | None) -> list[tuple[Cursor, GatewayEvent]]:
    with engine.transaction(write=False):
        return read_gateway_events(engine, span, after=cursor, limit=PAGE)


async def _page(kept: list[GatewayEvent], cursor: Cursor | None) -> Response:
    following = None if cursor is None else ".".join(str(part) for part in cursor)
    shown = await asyncio.to_thread(lambda: [cloudevent(one) for one in kept])
    return JsonResponse({"happenings": shown, "next": following})


def _cursor(text: str) -> Cursor:
    try:
        at_ns, place, number = (int(part) for part in text.split("."))
    except ValueError:
        raise InvalidRequestError("after is the `next` of the page before") from None
    return Cursor(at_ns, place, number)


def _sees(principal: Principal, gateway_event: GatewayEvent) -> bool:
    return principal.sees(gateway_event.robot) if gateway_event.robot else principal.sees_all


def _made(request: Request, principal: Principal, entry: models.PutHappening, place: int, now_ns: int) -> GatewayEvent:
    at = f"entries[{place}]"
    if any(word.strip().casefold().startswith(JOURNAL) for word in (entry.type, entry.source)):
        raise InvalidRequestError(f"{at}: types and sources that begin with {JOURNAL} are the gateway's own")
    for name in ("id", "type", "source", "robot"):
        if not getattr(entry, name).isprintable():
            raise InvalidRequestError(f"{at}.{name}: printable characters")
    if entry.robot:
        require_visible(request, entry.robot)
    elif not principal.sees_all:
        raise ForbiddenError(f"{at}.robot: whoever does not see every robot names one of theirs")
    return GatewayEvent(
        id=entry.id or new_command_id(now_ns),
        type=entry.type,
        source=entry.source,
        at_ns=parse_time(entry.time, now_ns=now_ns) if entry.time else now_ns,
        robot=entry.robot,
        data=entry.detail,
    )
