"""`/lambda/…`: every operation of AWS Lambda's API, by the signature that `signed` has checked, and links to code."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from typing import Any

from fastapi import APIRouter
from fastapi.routing import APIRoute
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from gateway.api.authorization import authorize, principal_of, require_all_robots, require_permission
from gateway.api.aws.errors import LinkExpiredError
from gateway.api.aws.invoke import call_function
from gateway.api.aws.prefix import LINKS, PREFIX
from gateway.api.aws.shaped import REASON_KEY
from gateway.api.aws.signed import SIGNED_KEY, Asked
from gateway.api.aws.wire import read_members, split_zip
from gateway.api.middleware.audited import note
from gateway.api.problem import JsonResponse, NotFoundError
from gateway.api.services import services_of
from gateway.automation.functions.catalogue.catalogue import Catalogue
from gateway.automation.functions.catalogue.shapes import check_input, model
from gateway.automation.functions.service import Functions
from gateway.domain.principal import Role
from gateway.identity.permissions import permission
from metaros.automation.functions.errors import ThrottledError

__all__ = ["CALLS", "router"]

METHODS = ["GET", "POST", "PUT", "DELETE"]
HIDDEN = {"ErrorCode": "AccessDeniedException", "Message": "Variables are shown to who may change them."}

router = APIRouter(include_in_schema=False)  # botocore's model describes it


@router.get("/lambda/code/{token}", dependencies=[require_permission("functions.fetch")])
async def fetch_code(request: Request, token: str) -> Response:
    """A zip file, by the link that GetFunction gave."""
    catalogue = _functions(request).catalogue
    sha256 = catalogue.links.read(token)
    if sha256 is None:
        raise LinkExpiredError("The link to this code is not good, or not any more: ask for another by GetFunction")
    size, pieces = await catalogue.pieces(sha256)
    return StreamingResponse(_off_loop(pieces), media_type="application/zip", headers={"content-length": str(size)})


@router.api_route("/lambda/{path:path}", methods=METHODS, dependencies=[require_permission("lambda.call")])
async def operate(request: Request) -> Response:
    """One operation."""
    asked: Asked = request.scope[SIGNED_KEY]
    if asked.found is None:
        raise NotFoundError("AWS Lambda has no operation at this path")
    operation, uri = asked.found
    row = Catalogue.operation(operation)
    authorize(request, permission(row.permission))
    require_all_robots(request, "functions")
    if asked.in_audit:
        request.state.permission = permission("lambda.call")  # which changes nothing that would be written down
    headers = dict(request.headers.items())
    body: Any = asked.data
    if asked.file is not None:
        body = await asyncio.to_thread(split_zip, asked.file, asked.file.with_name("code.zip"))
    members = read_members(operation, uri, asked.query, headers, body)
    services = _functions(request)
    if row.run is None:
        check_input(operation, members)
        try:
            return await call_function(operation, members, services, trace_id=headers.get("x-amzn-trace-id", ""))
        except ThrottledError as error:
            request.scope[REASON_KEY] = error.reason
            raise
    answer = await services.catalogue.do(operation, members)
    if row.writes:
        note(request, detail=f"{operation} {uri.get('FunctionName') or members.get('FunctionName', '')}"[:200])
    return _answer(request, operation, _shown(request, services, answer))


# By far the most of what comes are calls: they go straight there, see middleware/fast_path.py. No POST is for a link.
CALLS = {f"{PREFIX}/": route for route in router.routes if isinstance(route, APIRoute) and route.endpoint is operate}


def _functions(request: Request) -> Functions:
    return services_of(request).functions


def _answer(request: Request, operation: str, answer: dict[str, Any]) -> Response:
    status = int(model().operation_model(operation).http.get("responseCode", 200))
    return Response(status_code=status) if status == 204 else JsonResponse(answer, status_code=status)


def _shown(request: Request, services: Functions, answer: dict[str, Any]) -> dict[str, Any]:
    """The answer with links to code in place of its hashes, and without variables for who may not change them."""
    for name in ("Code", "Content"):
        if (place := answer.get(name)) and "Location" in place:
            token = services.catalogue.links.make(place["Location"])
            place["Location"] = f"{request.url.scheme}://{request.url.netloc}{LINKS}{token}"
    if principal_of(request).role < Role.ADMIN:
        for item in (
            answer,
            answer.get("Configuration", {}),
            *answer.get("Functions", ()),
            *answer.get("Versions", ()),
        ):
            if "Environment" in item:
                item["Environment"] = {"Error": HIDDEN}
    return answer


async def _off_loop(pieces: Iterator[bytes]) -> AsyncIterator[bytes]:
    """Pieces that block, each on a thread."""
    while (piece := await asyncio.to_thread(next, pieces, None)) is not None:
        yield piece
