"""Replays: what happened in a span is given to a function once more."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_all_robots, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.models import dead_letters as m
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.times import parse_time
from gateway.api.services import services_of
from gateway.api.views.robots import rfc3339
from gateway.automation.functions.replays import Replayer
from gateway.domain.automation.gateway_event import Replay, Span
from gateway.domain.errors import UnknownReplayError
from gateway.domain.fleet.command import new_command_id
from gateway.errors import InvalidRequestError
from metaros.automation.rules.errors import PatternError

__all__ = ["router"]

router = api_router("/api/v1", tags=["functions"])


@router.post(
    "/functions/{name}/replay",
    status_code=202,
    dependencies=[require_permission("functions.write")],
    responses={202: {"model": m.Replay}, **PROBLEMS},
    openapi_extra=body_document(m.ReplayRequest),
)
async def replay_function(request: Request, name: str) -> Response:
    """Give a function what happened in a span once more, each happening once."""
    require_all_robots(request, "replays")
    body = await read_body(request, m.ReplayRequest)
    services = services_of(request)
    now_ns = services.clock.wall_ns()
    span = Span(
        from_ns=parse_time(body.start, now_ns=now_ns),
        to_ns=parse_time(body.until, now_ns=now_ns),
        types=tuple(body.types),
    )
    if span.from_ns >= span.to_ns:
        raise InvalidRequestError("from: it is before until")
    spec: dict[str, Any] = {"function": name, "qualifier": body.qualifier, "pattern": body.pattern}
    replay = Replay(id=new_command_id(now_ns), span=span, spec=spec, made_ns=now_ns)
    try:
        begun = await _replayer(request).begin(replay)
    except PatternError as error:
        raise InvalidRequestError(f"pattern: {error}") from error
    note(request, detail=f"{name} {begun.id}")
    headers = {"location": f"/api/v1/replays/{begun.id}"}
    return JsonResponse(_view(begun), status_code=202, headers=headers)


@router.get("/replays", dependencies=[require_permission("functions.read")], responses={200: {"model": m.ReplayList}})
async def list_replays(request: Request) -> Response:
    """Those under way, then the newest that ended."""
    return JsonResponse({"replays": [_view(item) for item in await services_of(request).queue.replays()]})


@router.get(
    "/replays/{replay_id}",
    dependencies=[require_permission("functions.read")],
    responses={200: {"model": m.Replay}, **PROBLEMS},
)
async def get_replay(request: Request, replay_id: str) -> Response:
    """How far one is."""
    return JsonResponse(_view(await _found(request, replay_id)))


@router.delete(
    "/replays/{replay_id}",
    dependencies=[require_permission("functions.write")],
    responses={200: {"model": m.Replay}, **PROBLEMS},
)
async def stop_replay(request: Request, replay_id: str) -> Response:
    """End one; what it put is delivered all the same."""
    require_all_robots(request, "replays")
    await _found(request, replay_id)
    await services_of(request).queue.stop_replay(replay_id)
    note(request, detail=replay_id)
    return JsonResponse(_view(await _found(request, replay_id)))


def _replayer(request: Request) -> Replayer:
    services = services_of(request)
    return Replayer(services.queue.replay, services.functions.catalogue)


async def _found(request: Request, replay_id: str) -> Replay:
    for item in await services_of(request).queue.replays():
        if item.id == replay_id:
            return item
    raise UnknownReplayError(f"there is no replay {replay_id[:64]!r}")


def _view(replay: Replay) -> dict[str, Any]:
    ended = {"": "done", "stopped": "stopped"}.get(replay.code, "failed")
    return {
        "id": replay.id,
        "function": str(replay.spec.get("function", "")),
        "state": ended if replay.ended_ns else "running",
        "start": rfc3339(replay.span.from_ns),
        "until": rfc3339(replay.span.to_ns),
        "seen": replay.read,
        "put": replay.put,
        "message": replay.code,
    }
