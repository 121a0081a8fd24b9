"""Recordings: ask for a robot's last minutes, follow them on their way, fetch the file, delete it."""

from __future__ import annotations

from typing import Annotated, Any

import orjson
from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import FieldsText, read_fields
from gateway.api.models import common
from gateway.api.models.recordings import Recording, RecordingList, RecordingRequest
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.downloads import DownloadResponse
from gateway.api.rest.once import carried_once, key_of
from gateway.api.rest.spans import asked_span
from gateway.api.rest.times import parse_time
from gateway.api.services import services_of
from gateway.api.views.robots import rfc3339
from gateway.domain.fleet import recording as domain
from gateway.errors import InvalidRequestError, UnknownRecordingError
from gateway.fleet.command_manager import NewCommand
from gateway.history.recordings.download import Download

__all__ = ["router"]

MAX_LISTED = 1000
MEDIA_TYPE = "application/mcap"

router = api_router("/api/v1", tags=["recordings"])


@router.post(
    "/robots/{robot_id}/recordings",
    dependencies=[require_permission("recordings.save")],
    status_code=202,
    responses={202: {"model": Recording}, **PROBLEMS, 429: {"model": common.Problem}},
    openapi_extra=body_document(RecordingRequest),
)
async def save_recording(request: Request, robot_id: str) -> Response:
    """Ask for a clip of the robot's black box. The robot may be offline: it is asked when it comes."""
    manager = services_of(request).recordings
    body = await read_body(request, RecordingRequest)
    if (body.last_s is None) == (not body.start):
        raise InvalidRequestError("say either last_s, or start and end")
    if (key := key_of(request)) is not None:
        return await _save_once(request, robot_id, body, key)
    span_ns = None
    if body.start:
        now_ns = manager.robot_now_ns(robot_id)
        span_ns = (parse_time(body.start, now_ns=now_ns), parse_time(body.end, now_ns=now_ns))
    asked = await manager.request(robot_id, last_s=body.last_s, span_ns=span_ns, topics=tuple(body.topics))
    headers = {"location": f"/api/v1/recordings/{asked.id}"}
    return JsonResponse(recording_view(asked), status_code=202, headers=headers)


async def _save_once(request: Request, robot_id: str, body: RecordingRequest, key: str) -> Response:
    if body.last_s is None:
        raise InvalidRequestError("under an Idempotency-Key a clip is named by last_s")
    asked: dict[str, Any] = {"last_s": body.last_s, "topics": list(body.topics)}
    ended = await carried_once(
        request, NewCommand(robot=robot_id, kind="save_recording", request=asked, idempotency=key)
    )
    found = await _get(request, orjson.loads(ended.result)["recording"])
    headers = {"location": f"/api/v1/recordings/{found.id}"}
    return JsonResponse(recording_view(found), status_code=202, headers=headers)


@router.get(
    "/recordings", dependencies=[require_permission("recordings.read")], responses={200: {"model": RecordingList}}
)
async def list_recordings(
    request: Request,
    robot: Annotated[str, Query(description="only this robot's")] = "",
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = 100,
    before: Annotated[str, Query(description="the `next` of the page before")] = "",
    fields: FieldsText = "",
) -> Response:
    """The newest recordings, newest first."""
    found = await _seen(request, robot or None, limit=limit + 1, before=before or None)
    page = found[:limit]
    following = page[-1].id if len(found) > limit else None
    chosen = read_fields(fields, Recording)
    return JsonResponse({"recordings": [chosen.of(recording_view(item)) for item in page], "next": following})


@router.get(
    "/recordings/{recording_id}",
    dependencies=[require_permission("recordings.read")],
    responses={200: {"model": Recording}, 404: {"model": common.Problem}},
)
async def get_recording(request: Request, recording_id: str) -> Response:
    """One recording, and how far it is."""
    return JsonResponse(recording_view(await _get(request, recording_id)))


@router.delete(
    "/recordings/{recording_id}",
    dependencies=[require_permission("recordings.delete")],
    responses={200: {"model": common.Ok}, **PROBLEMS},
)
async def delete_recording(request: Request, recording_id: str) -> Response:
    """Delete a recording with its file; an unfinished one is given up, and its robot forgets it."""
    if not principal_of(request).sees_all:
        await _get(request, recording_id)
    await services_of(request).recordings.delete(recording_id)
    return JsonResponse({"ok": True})


@router.get(
    "/recordings/{recording_id}/file.mcap",
    dependencies=[require_permission("recordings.read")],
    responses={
        200: {"content": {MEDIA_TYPE: {}}},
        206: {"content": {MEDIA_TYPE: {}}},
        304: {},
        416: {},
        404: {"model": common.Problem},
        409: {"model": common.Problem},
        429: {"model": common.Problem},
    },
    response_class=StreamingResponse,
)
async def get_file(request: Request, recording_id: str) -> Response:
    """The recording's MCAP file, streamed; one byte range may be asked for, so that a download goes on."""
    manager = services_of(request).recordings
    found = await _get(request, recording_id)
    if found.state != domain.STORED:
        manager.download(found).close()  # says why there is none
    etag = f'"{found.sha256}"'
    headers = {
        "etag": etag,
        "accept-ranges": "bytes",
        "cache-control": "private, max-age=31536000, immutable",
        "content-disposition": f'attachment; filename="{file_name(found)}"',
    }
    if etag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    span = asked_span(request, found.size_bytes, etag)
    if span is None:
        return _sent(request, manager.download(found), found.size_bytes, headers, status_code=200)
    start, end = span
    if start >= end:
        return Response(status_code=416, headers={**headers, "content-range": f"bytes */{found.size_bytes}"})
    headers["content-range"] = f"bytes {start}-{end - 1}/{found.size_bytes}"
    part = manager.download(found, start=start, size_bytes=end - start)
    return _sent(request, part, end - start, headers, status_code=206)


def recording_view(item: domain.Recording) -> dict[str, Any]:
    """A recording as the API shows it."""
    stored = item.state == domain.STORED
    return {
        "id": item.id,
        "robot": item.robot,
        "state": item.state,
        "start": rfc3339(item.from_ns),
        "end": rfc3339(item.to_ns),
        "first": rfc3339(item.first_ns) if item.first_ns else None,
        "last": rfc3339(item.last_ns) if item.last_ns else None,
        "topics": list(item.topics),
        "requested": rfc3339(item.requested_ns),
        "size_bytes": item.size_bytes,
        "received_bytes": item.received_bytes,
        "messages": item.messages,
        "sha256": item.sha256 or None,
        "code": item.code,
        "message": item.message,
        "url": f"/api/v1/recordings/{item.id}/file.mcap" if stored else None,
    }


def file_name(item: domain.Recording) -> str:
    """What a download is called: the robot and when the clip begins."""
    moment = rfc3339(item.first_ns or item.from_ns)[:19].replace(":", "-")
    return f"{item.robot}_{moment}Z.mcap"


async def _get(request: Request, recording_id: str) -> domain.Recording:
    """One recording; UnknownRecordingError also where its robot is out of scope."""
    found = await services_of(request).recordings.get(recording_id)
    if not principal_of(request).sees(found.robot):
        raise UnknownRecordingError.of(recording_id)
    return found


async def _seen(request: Request, robot_id: str | None, *, limit: int, before: str | None) -> list[domain.Recording]:
    """The newest recordings of robots in scope; of many others, only as many are read at a time as may be listed."""
    manager, principal = services_of(request).recordings, principal_of(request)
    if principal.sees_all or robot_id is not None:
        unseen = robot_id is not None and not principal.sees(robot_id)
        return [] if unseen else await manager.list(robot_id=robot_id, limit=limit, before=before)
    kept: list[domain.Recording] = []
    while len(kept) < limit:
        page = await manager.list(robot_id=None, limit=MAX_LISTED, before=before)
        kept += [item for item in page if principal.sees(item.robot)]
        if len(page) < MAX_LISTED:
            break
        before = page[-1].id
    return kept[:limit]


def _sent(request: Request, part: Download, size_bytes: int, headers: dict[str, str], *, status_code: int) -> Response:
    sized = {**headers, "content-length": str(size_bytes)}
    return DownloadResponse(
        request, part, what="a download", media_type=MEDIA_TYPE, headers=sized, status_code=status_code
    )
