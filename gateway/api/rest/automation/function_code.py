"""A function's code: listed, shown, and taken in as a zip file of any size that functions may have."""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path
from typing import Annotated, Any

from fastapi import Query
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from gateway.api.authorization import require_all_robots, require_permission
from gateway.api.function_details import detail
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.middleware.guard import UPLOAD_TYPE
from gateway.api.models import functions as m
from gateway.api.problem import JsonResponse
from gateway.api.rest.automation.functions import deploy
from gateway.api.rest.bodies import PROBLEMS
from gateway.api.services import services_of
from gateway.automation.functions.errors import UnknownFunctionError
from gateway.errors import MediaTypeError, RequestTimeoutError
from metaros.limits import LIMITS

__all__ = ["router"]

Version = Annotated[str, Query(max_length=128, description="a version or an alias")]
ZIP: dict[str, Any] = {
    "requestBody": {"required": True, "content": {UPLOAD_TYPE: {"schema": {"type": "string", "format": "binary"}}}}
}

router = api_router("/api/v1/functions/{name}/code", tags=["functions"])


@router.get("", dependencies=[require_permission("functions.read")], responses={200: {"model": m.Code}, **PROBLEMS})
async def list_code(request: Request, name: str, version: Version = "$LATEST") -> Response:
    """The files of a version's code."""
    folder, number = await _folder(request, name, version)
    files, truncated = await asyncio.to_thread(_files, folder)
    return JsonResponse({"version": number, "files": files, "truncated": truncated})


@router.get(
    "/text", dependencies=[require_permission("functions.read")], responses={200: {"model": m.CodeText}, **PROBLEMS}
)
async def get_code(
    request: Request,
    name: str,
    path: Annotated[str, Query(min_length=1, max_length=1024, description="of `files`")],
    version: Version = "$LATEST",
) -> Response:
    """One file's text, its beginning at least."""
    folder, _ = await _folder(request, name, version)
    found = await asyncio.to_thread(_text, folder, path)
    if found is None:
        raise UnknownFunctionError(f"the code of {name} has no file {path[:200]!r}")
    return JsonResponse({"path": path, "text": found[0], "truncated": found[1]})


@router.put(
    "",
    dependencies=[require_permission("functions.write")],
    responses={200: {"model": m.FunctionDetail}, 201: {"model": m.FunctionDetail}, **PROBLEMS},
    openapi_extra=ZIP,
)
async def put_code(
    request: Request,
    name: str,
    handler: Annotated[str, Query(max_length=128, description="needed where the function is new")] = "",
    runtime: Annotated[str, Query(max_length=32)] = "",
    publish: bool = False,
    alias: Annotated[str, Query(max_length=128, description="leads to the new version")] = "",
) -> Response:
    """Take in a zip file as the function's code."""
    require_all_robots(request, "functions")
    if request.headers.get("content-type", "").split(";")[0].strip().lower() != UPLOAD_TYPE:
        raise MediaTypeError(f"code has Content-Type {UPLOAD_TYPE}")
    services = services_of(request)
    body = m.Deploy(handler=handler or None, runtime=runtime or None, publish=publish, alias=alias)
    with tempfile.TemporaryDirectory(prefix="upload-", dir=services.settings.data_dir) as folder:
        path = Path(folder) / "code.zip"
        await _receive(request, path)
        made = await deploy(services, name, body, path)
    note(request, detail=f"{name} {'made' if made else 'changed'} with code")
    found = await detail(services, name, window_s=3600.0, secrets=True)
    return JsonResponse(found, status_code=201 if made else 200)


async def _receive(request: Request, path: Path) -> None:
    """Write the body to a file, piece by piece; bodies.py bounds it in bytes and time."""
    with await asyncio.to_thread(path.open, "wb") as file:
        try:
            async for piece in request.stream():
                await asyncio.to_thread(file.write, piece)
        except ClientDisconnect as error:
            raise RequestTimeoutError("the connection ended within the body") from error


async def _folder(request: Request, name: str, version: str) -> tuple[Path, str]:
    catalogue = services_of(request).functions.catalogue
    number = catalogue.resolve(name, version).versions[0][0]
    return await catalogue.files(name, number), number


def _files(folder: Path) -> tuple[list[dict[str, Any]], bool]:
    found: list[dict[str, Any]] = []
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            if len(found) == LIMITS.function_code_files:
                return found, True
            found.append({"path": path.relative_to(folder).as_posix(), "size_bytes": path.stat().st_size})
    return found, False


def _text(folder: Path, path: str) -> tuple[str, bool] | None:
    file = folder / path
    if not file.is_file() or file.is_symlink() or not file.resolve().is_relative_to(folder.resolve()):
        return None
    most = LIMITS.function_code_text_bytes
    with file.open("rb") as opened:
        data = opened.read(most + 1)
    return data[:most].decode("utf-8", "replace"), len(data) > most
