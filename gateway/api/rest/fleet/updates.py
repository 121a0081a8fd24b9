"""Update files: what people publish, what robots fetch by their token, and what there is."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import Query
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response, StreamingResponse

from gateway.api import models, models_updates
from gateway.api.allow import allow, principal_of, require_all
from gateway.api.audited import note
from gateway.api.guard import UPLOAD_TYPE
from gateway.api.later_route import api_router
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.downloads import DownloadResponse
from gateway.api.rest.spans import asked_span
from gateway.api.services import services_of
from gateway.api.views import rfc3339
from gateway.errors import MediaTypeError, RequestTimeoutError
from gateway.store.updates import StoredBundle
from gateway.updates.publish import Upload
from gateway.updates.repository import Repository
from gateway.updates.roles import ONLINE

__all__ = ["bundle_view", "router"]

MISSING: dict[int | str, dict[str, Any]] = {404: {"model": models.Problem}, 410: {"model": models.Problem}}

router = api_router("/api/v1/updates", tags=["updates"])


@router.get("", dependencies=[allow("updates.read")], responses={200: {"model": models_updates.UpdateList}})
async def list_updates(request: Request) -> Response:
    """Every bundle, the newest first, and how long what was signed counts."""
    desk = _desk(request)
    documents, signed = await desk.documents(), await desk.signed()
    roles = [
        {
            "role": role,
            "version": one.version,
            "expires": rfc3339(one.expires_ns),
            "online": role in ONLINE,
        }
        for role, one in documents.items()
    ]
    bundles = [bundle_view(one, signed) for one in await desk.bundles()]
    return JsonResponse({"roles": roles, "bundles": bundles, "trouble": desk.trouble})


@router.post(
    "/online-keys",
    dependencies=[allow("updates.publish")],
    responses={200: {"model": models_updates.OnlineKeys}, **PROBLEMS},
    openapi_extra=body_document(models_updates.OnlineKeysRequest),
)
async def online_keys(request: Request) -> Response:
    """The public keys that a root has to name for this store, made when they are first asked for."""
    require_all(request, "updates")
    body = await read_body(request, models_updates.OnlineKeysRequest)
    note(request, detail="new online keys" if body.fresh else "online keys")
    return JsonResponse({"keys": await _desk(request).online_keys(fresh=body.fresh)})


@router.post(
    "/metadata",
    dependencies=[allow("updates.publish")],
    responses={200: {"model": models_updates.Published}, **PROBLEMS},
    openapi_extra=body_document(models_updates.SignedUpload),
)
async def publish(request: Request) -> Response:
    """Publish what was signed offline. All of it is taken, or nothing is."""
    require_all(request, "updates")
    body = await read_body(request, models_updates.SignedUpload)
    upload = Upload(
        roots=[text.encode("utf-8", "surrogatepass") for text in body.roots],
        targets=body.targets.encode("utf-8", "surrogatepass") if body.targets is not None else None,
        groups={role: text.encode("utf-8", "surrogatepass") for role, text in body.groups.items()},
    )
    versions = await _desk(request).publish(upload)
    note(request, detail=" ".join(f"{role} {version}" for role, version in sorted(versions.items()))[:500])
    return JsonResponse({"roles": versions})


@router.get("/metadata/{file:path}", dependencies=[allow("updates.fetch")], responses={**MISSING})
async def get_metadata(request: Request, file: str) -> Response:
    """A signed document, for robots: timestamp.json, or one by its version such as 3.targets.json."""
    return Response((await _desk(request).metadata(file)).document, media_type="application/json")


@router.get(
    "/targets/{file:path}",
    dependencies=[allow("updates.fetch")],
    responses={
        200: {"content": {UPLOAD_TYPE: {}}},
        206: {"content": {UPLOAD_TYPE: {}}},
        416: {},
        429: {"model": models.Problem},
        **MISSING,
    },
    response_class=StreamingResponse,
)
async def get_target(request: Request, file: str) -> Response:
    """A bundle, for robots; one byte range may be asked for, so that a download goes on."""
    desk = _desk(request)
    found = await desk.target(file)
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
        desk.fetch(found, start=start, size_bytes=end - start, robot=principal_of(request).id),
        what="a bundle",
        media_type=UPLOAD_TYPE,
        headers={**headers, "content-length": str(end - start)},
        status_code=200 if span is None else 206,
    )


@router.post(
    "/bundles",
    status_code=201,
    dependencies=[allow("updates.publish")],
    responses={201: {"model": models_updates.Bundle}, **PROBLEMS, 429: {"model": models.Problem}},
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
    require_all(request, "updates")
    if request.headers.get("content-type", "").split(";")[0].strip().lower() != UPLOAD_TYPE:
        raise MediaTypeError(f"a bundle has Content-Type {UPLOAD_TYPE}")
    desk = _desk(request)
    taken = await desk.shelf.take(_pieces(request), group=group, by=principal_of(request).name)
    note(request, detail=f"{taken.path} {taken.sha256[:12]}")
    return JsonResponse(bundle_view(taken, await desk.signed()), status_code=201)


@router.get(
    "/bundles/{path:path}",
    dependencies=[allow("updates.read")],
    responses={200: {"model": models_updates.Bundle}, 404: {"model": models.Problem}},
)
async def get_bundle(request: Request, path: str) -> Response:
    """One bundle by its target path, such as nodes/lidar-node/1.2.0.zip."""
    desk = _desk(request)
    return JsonResponse(bundle_view(await desk.bundle(path), await desk.signed()))


@router.post(
    "/withdrawals",
    dependencies=[allow("updates.publish")],
    responses={200: {"model": models_updates.Bundle}, **PROBLEMS},
    openapi_extra=body_document(models_updates.WithdrawRequest),
)
async def withdraw(request: Request) -> Response:
    """Hand a version out no more, at once; robots that run it keep it until they are told otherwise."""
    require_all(request, "updates")
    body = await read_body(request, models_updates.WithdrawRequest)
    desk = _desk(request)
    gone = await desk.withdraw(body.path, body.reason)
    note(request, detail=f"withdrawn: {gone.path}")
    return JsonResponse(bundle_view(gone, await desk.signed()))


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


def _desk(request: Request) -> Repository:
    return services_of(request).updates


async def _pieces(request: Request) -> AsyncIterator[bytes]:
    try:
        async for piece in request.stream():
            yield piece
    except ClientDisconnect:
        raise RequestTimeoutError("the connection ended within the body") from None
