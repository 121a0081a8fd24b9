"""Update files: what people publish, what robots fetch by their token, and what there is."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import Query
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response, StreamingResponse

from gateway.api.authorization import principal_of, require_all_robots, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.middleware.guard import UPLOAD_TYPE
from gateway.api.models import common, updates
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.downloads import DownloadResponse
from gateway.api.rest.spans import asked_span
from gateway.api.services import services_of
from gateway.api.views.robots import rfc3339
from gateway.errors import MediaTypeError, RequestTimeoutError
from gateway.fleet.updates.publish import Upload
from gateway.fleet.updates.repository import Repository
from gateway.fleet.updates.roles import ONLINE
from gateway.store.fleet.updates import StoredBundle

__all__ = ["bundle_view", "router"]

MISSING: dict[int | str, dict[str, Any]] = {404: {"model": common.Problem}, 410: {"model": common.Problem}}

router = api_router("/api/v1/updates", tags=["updates"])


@router.get("", dependencies=[require_permission("updates.read")], responses={200: {"model": updates.UpdateList}})
async def list_updates(request: Request) -> Response:
    """Every bundle, the newest first, and how long what was signed counts."""
    repository = _repository(request)
    documents, signed = await repository.documents(), await repository.signed()
    roles = [
        {
            "role": role,
            "version": one.version,
            "expires": rfc3339(one.expires_ns),
            "online": role in ONLINE,
        }
        for role, one in documents.items()
    ]
    bundles = [bundle_view(one, signed) for one in await repository.bundles()]
    return JsonResponse({"roles": roles, "bundles": bundles, "trouble": repository.trouble})


@router.post(
    "/online-keys",
    dependencies=[require_permission("updates.publish")],
    responses={200: {"model": updates.OnlineKeys}, **PROBLEMS},
    openapi_extra=body_document(updates.OnlineKeysRequest),
)
async def online_keys(request: Request) -> Response:
    """The public keys that a root has to name for this store, made when they are first asked for."""
    require_all_robots(request, "updates")
    body = await read_body(request, updates.OnlineKeysRequest)
    note(request, detail="new online keys" if body.fresh else "online keys")
    return JsonResponse({"keys": await _repository(request).online_keys(fresh=body.fresh)})


@router.post(
    "/metadata",
    dependencies=[require_permission("updates.publish")],
    responses={200: {"model": updates.Published}, **PROBLEMS},
    openapi_extra=body_document(updates.SignedUpload),
)
async def publish(request: Request) -> Response:
    """Publish what was signed offline. All of it is taken, or nothing is."""
    require_all_robots(request, "updates")
    body = await read_body(request, updates.SignedUpload)
    upload = Upload(
        roots=[text.encode("utf-8", "surrogatepass") for text in body.roots],
        targets=body.targets.encode("utf-8", "surrogatepass") if body.targets is not None else None,
        groups={role: text.encode("utf-8", "surrogatepass") for role, text in body.groups.items()},
    )
    versions = await _repository(request).publish(upload)
    note(request, detail=" ".join(f"{role} {version}" for role, version in sorted(versions.items()))[:500])
    return JsonResponse({"roles": versions})


@router.get("/metadata/{file:path}", dependencies=[require_permission("updates.fetch")], responses={**MISSING})
async def get_metadata(request: Request, file: str) -> Response:
    """A signed document, for robots: timestamp.json, or one by its version such as 3.targets.json."""
    return Response((await _repository(request).metadata(file)).document, media_type="application/json")


@router.get(
    "/targets/{file:path}",
    dependencies=[require_permission("updates.fetch")],
    responses={
        200: {"content": {UPLOAD_TYPE: {}}},
        206: {"content": {UPLOAD_TYPE: {}}},
        416: {},
        429: {"model": common.Problem},
        **MISSING,
    },
    response_class=StreamingResponse,
)
async def get_target(request: Request, file: str) -> Response:
    """A bundle, for robots; one byte range may be asked for, so that a download goes on."""
    repository = _repository(request)
    found = await repository.target(file)
    etag = f'"{found.sha256}"'
    headers = {"etag": etag, "accept-ranges": "bytes"}
    span = asked_span(request, found.size_bytes, etag)
    start, end = span or (0, found.size_bytes)
    if start >= end:
        return Response(status_code=416, headers={**headers, "content-range": f"bytes */{found.size_bytes}"})
    if span is not None:
        headers["content-range"] = f"bytes {start}-{end - 1}/{found.size_bytes}"
    return DownloadResponse(
        request,
        repository.fetch(found, start=start, size_bytes=end - start, robot=principal_of(request).id),
        what="a bundle",
        media_type=UPLOAD_TYPE,
        headers={**headers, "content-length": str(end - start)},
        status_code=200 if span is None else 206,
    )


@router.post(
    "/bundles",
    status_code=201,
    dependencies=[require_permission("updates.publish")],
    responses={201: {"model": updates.Bundle}, **PROBLEMS, 429: {"model": common.Problem}},
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {UPLOAD_TYPE: {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def upload_bundle(
    request: Request, group: Annotated[str, Query(max_length=63, description="whose delegated role signs it")] = ""
) -> Response:
    """Take a bundle in; robots can have it once it is named by signed targets."""
    require_all_robots(request, "updates")
    if request.headers.get("content-type", "").split(";")[0].strip().lower() != UPLOAD_TYPE:
        raise MediaTypeError(f"a bundle has Content-Type {UPLOAD_TYPE}")
    repository = _repository(request)
    taken = await repository.uploads.take(_pieces(request), group=group, by=principal_of(request).name)
    note(request, detail=f"{taken.path} {taken.sha256[:12]}")
    return JsonResponse(bundle_view(taken, await repository.signed()), status_code=201)


@router.get(
    "/bundles/{path:path}",
    dependencies=[require_permission("updates.read")],
    responses={200: {"model": updates.Bundle}, 404: {"model": common.Problem}},
)
async def get_bundle(request: Request, path: str) -> Response:
    """One bundle by its target path, such as nodes/lidar-node/1.2.0.zip."""
    repository = _repository(request)
    return JsonResponse(bundle_view(await repository.bundle(path), await repository.signed()))


@router.post(
    "/withdrawals",
    dependencies=[require_permission("updates.publish")],
    responses={200: {"model": updates.Bundle}, **PROBLEMS},
    openapi_extra=body_document(updates.WithdrawRequest),
)
async def withdraw(request: Request) -> Response:
    """Hand a version out no more, at once; robots that run it keep it until they are told otherwise."""
    require_all_robots(request, "updates")
    body = await read_body(request, updates.WithdrawRequest)
    repository = _repository(request)
    gone = await repository.withdraw(body.path, body.reason)
    note(request, detail=f"withdrawn: {gone.path}")
    return JsonResponse(bundle_view(gone, await repository.signed()))


def bundle_view(one: StoredBundle, signed: dict[str, str]) -> dict[str, Any]:
    """A bundle as the API shows it."""
    return {
        "path": one.path,
        "kind": one.kind,
        "name": one.name,
        "version": one.version,
        "min_version": one.manifest.get("min_version", ""),
        "hw": one.manifest.get("hw", []),
        "python": one.manifest.get("python", ""),
        "sha256": one.sha256,
        "size_bytes": one.size_bytes,
        "signed": signed.get(one.path) == one.sha256,
        "uploaded": rfc3339(one.uploaded_ns),
        "uploaded_by": one.uploaded_by,
        "withdrawn": rfc3339(one.withdrawn_ns) if one.withdrawn_ns else None,
        "reason": one.reason,
    }


def _repository(request: Request) -> Repository:
    return services_of(request).updates


async def _pieces(request: Request) -> AsyncIterator[bytes]:
    try:
        async for piece in request.stream():
            yield piece
    except ClientDisconnect:
        raise RequestTimeoutError("the connection ended within the body") from None
