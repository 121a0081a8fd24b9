"""Calls of functions: made, looked at, and what they print. Of robots out of one's scope there are none."""

from __future__ import annotations

import asyncio
import platform
from collections.abc import Callable
from dataclasses import asdict
from typing import Annotated, Literal

import orjson
from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_all_robots, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.models import functions as m
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS
from gateway.api.rest.downloads import DownloadResponse
from gateway.api.rest.sse import EVENT_STREAM, HEADERS, EventPieces, server_event
from gateway.api.services import services_of
from gateway.api.views.functions import invocation_view, invoked_view, line_view
from gateway.automation.functions.errors import PayloadInvalidError
from gateway.automation.functions.logs import LogLine
from gateway.domain.automation.invocation import ROBOT, InvocationFilter
from gateway.errors import InvalidRequestError, TooManyRequestsError
from metaros.automation.functions.errors import ThrottledError

__all__ = ["router"]

MAX_LISTED = 1000
THROTTLED_S = 1.0
PARSED_BYTES = 64 << 10  # of a payload
JSON_BODY = {"requestBody": {"required": True, "content": {"application/json": {"schema": {}}}}}
Qualifier = Annotated[str, Query(max_length=128, description="a version or an alias; else `$LATEST`")]
Kind = Annotated[
    Literal["request", "event", "dry"],
    Query(description="wait for the answer; or let it be called later, and again where it fails; or only look"),
]
Before = Annotated[str, Query(max_length=64, description="the `next` of the page before")]

router = api_router("/api/v1", tags=["functions"])


@router.post(
    "/functions/{name}/invoke",
    dependencies=[require_permission("functions.invoke")],
    responses={200: {"model": m.Invoked}, 202: {"model": m.Invoked}, **PROBLEMS},
    openapi_extra=JSON_BODY,
)
async def invoke_function(request: Request, name: str, qualifier: Qualifier = "", kind: Kind = "request") -> Response:
    """Call a function with the body, which is any JSON. That it fails is an answer: see `status`."""
    payload = await request.body() or b"null"
    try:
        if len(payload) <= PARSED_BYTES:  # a larger one would hold up all else: the function's runtime reads it
            orjson.loads(payload)
    except orjson.JSONDecodeError as error:
        raise PayloadInvalidError(f"the body is no JSON: {error}") from error
    functions = services_of(request).functions
    if kind == "dry":
        target = functions.catalogue.resolve(name, qualifier)
        return JsonResponse({"request_id": "", "status": "dry", "version": target.versions[0][0]})
    if kind == "event":
        request_id = await functions.invoker.accept(name, qualifier, payload)
        note(request, detail=f"{name} event {request_id}")
        return JsonResponse({"request_id": request_id, "status": "accepted"}, status_code=202)
    try:
        invoked = await functions.invoker.invoke(name, qualifier, payload, kind="test")
    except ThrottledError as error:
        raise TooManyRequestsError(str(error), retry_after_s=THROTTLED_S) from error
    note(request, detail=f"{name} {invoked.request_id} {invoked.outcome.error_type or 'ok'}")
    return JsonResponse(invoked_view(invoked))


@router.get(
    "/functions/{name}/invocations",
    dependencies=[require_permission("functions.read")],
    responses={200: {"model": m.InvocationList}, **PROBLEMS},
)
async def list_invocations(
    request: Request,
    name: str,
    status: Annotated[m.InvocationStatus | Literal[""], Query()] = "",
    kind: Annotated[m.InvocationKind | Literal[""], Query()] = "",
    version: Annotated[str, Query(max_length=128)] = "",
    robot: Annotated[str, Query(max_length=64)] = "",
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = 100,
    before: Before = "",
) -> Response:
    """The newest calls, newest first. Who does not see every robot sees those about robots in scope, without logs."""
    services, whole = services_of(request), principal_of(request).sees_all
    if kind != ROBOT:  # on robots run functions that are no function here
        services.functions.catalogue.resolve(name)
    wanted = InvocationFilter(
        function=name, status=status, version=version, kind=kind, robot=robot, sees=_seer(request)
    )
    found = await services.functions.ledger.page(wanted, limit=limit + 1, before=before)
    page = [invocation_view(call, log=whole) for call in found[:limit]]
    return JsonResponse({"invocations": page, "next": found[limit - 1].id if len(found) > limit else None})


@router.get(
    "/functions/{name}/logs",
    dependencies=[require_permission("functions.read")],
    responses={200: {"model": m.FunctionLogPage, "content": {EVENT_STREAM: {}}}, **PROBLEMS},
)
async def get_logs(
    request: Request,
    name: str,
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = 200,
    before: Annotated[int | None, Query(ge=0)] = None,
    after: Annotated[int | None, Query(ge=0, description="of a stream: go on behind this line")] = None,
) -> Response:
    """What a function printed: the newest lines that this gateway has in memory; with `Accept: text/event-stream` what
    follows. Lines tell of any robot: they are for who sees them all.
    """
    require_all_robots(request, "logs of functions")
    functions = services_of(request).functions
    functions.catalogue.resolve(name)
    if EVENT_STREAM not in request.headers.get("accept", ""):
        lines = functions.logs.page(name, limit=limit, before=before)
        following = lines[0].cursor if len(lines) == limit else None
        return JsonResponse({"lines": [line_view(line) for line in lines], "next": following})
    pieces = EventPieces(functions.logs.follow(name, after=_last_line(request, after)), _written)
    return DownloadResponse(request, pieces, what="a live log", media_type=EVENT_STREAM, headers=HEADERS)


@router.get(
    "/functions-runtime", dependencies=[require_permission("functions.read")], responses={200: {"model": m.Runtime}}
)
async def get_runtime(request: Request) -> Response:
    """Where functions run here: the sandbox and why it is no stronger, workers, what they run on."""
    functions = services_of(request).functions
    state = await asyncio.to_thread(functions.engine.state)  # it reads the workers' memory
    status, choices = state.status, functions.choices
    pools = [asdict(pool) for pool in status.pools] if status is not None else []
    for pool in pools:
        del pool["key"]
    version = platform.python_version()
    return JsonResponse(
        {
            "on": choices.on,
            "started": status is not None,
            "trouble": state.trouble,
            "level": status.level.name if status is not None else "",
            "require": choices.require.name,
            "reasons": {level.name: text for level, text in status.reasons.items()} if status is not None else {},
            "entry": status.entry if status is not None else "",
            "interpreter": f"python{version}",
            "runtimes": ["python3.*"],
            "workers": status.workers if status is not None else 0,
            "most_workers": choices.workers,
            "memory_mb": sum(pool["memory_mb"] for pool in pools),
            "pools": pools,
        }
    )


def _seer(request: Request) -> Callable[[str], bool] | None:
    """Whose calls somebody may know of; None: all, those about no robot too."""
    principal = principal_of(request)
    return None if principal.sees_all else lambda robot: bool(robot) and principal.sees(robot)


def _last_line(request: Request, after: int | None) -> int | None:
    said = request.headers.get("last-event-id", "")
    if not said:
        return after
    if not said.isascii() or not said.isdigit():
        raise InvalidRequestError("Last-Event-ID is the cursor of a line")
    return int(said)


def _written(lines: list[LogLine]) -> bytes:
    return b"".join(server_event(line_view(line), cursor=str(line.cursor)) for line in lines)
