"""Errors as application/problem+json, and JSON responses without a detour through models."""

from __future__ import annotations

import math
from typing import Any

import orjson
from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.websockets import WebSocket

from gateway.automation.rules.errors import RuleInvalidError
from gateway.errors import (
    CommandRefusedError,
    ErrorRow,
    GatewayError,
    InvalidRequestError,
    LeaseTakenError,
    RequestError,
    TooManyRequestsError,
    error_row,
)
from metaros.automation.rules.errors import RuleTextError
from metaros.errors import MetarosError

__all__ = ["JsonResponse", "error_code", "install_problems", "problem", "problem_bytes", "problem_headers"]

PROBLEM_TYPE = "application/problem+json"


class NotFoundError(RequestError):
    """There is nothing at this path."""

    code = "not_found"


class MethodError(RequestError):
    """This path does not take that method."""

    code = "method_not_allowed"


class JsonResponse(JSONResponse):
    """JSON by orjson; numpy arrays go out as they are, NaN as null."""

    def render(self, content: Any) -> bytes:
        """The body."""
        return orjson.dumps(content, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS)


def error_code(error: MetarosError) -> str:
    """The code a client sees; a refusal shows the agent's own."""
    return (error.agent_code or error.code) if isinstance(error, CommandRefusedError) else error.code


def problem_bytes(error: MetarosError) -> tuple[ErrorRow, bytes]:
    """The table's row of an error and its problem document."""
    row = error_row(error)
    code = error_code(error)
    document: dict[str, Any] = {
        "type": f"urn:metaros:error:{code}",
        "title": row.title,
        "status": row.http,
        "code": code,
        "detail": str(error),
    }
    if isinstance(error, LeaseTakenError):
        document["holder"] = error.holder
    if isinstance(error, TooManyRequestsError):
        document["retry_after_s"] = error.retry_after_s
    if isinstance(error, RuleInvalidError | RuleTextError):
        document["path"] = error.path
    return row, orjson.dumps(document)


def problem_headers(error: MetarosError) -> dict[str, str]:
    """What a problem says in headers as well: when to come back, and how to say who one is."""
    if isinstance(error, TooManyRequestsError):
        return {"retry-after": str(max(1, math.ceil(error.retry_after_s)))}
    return {"www-authenticate": "Bearer"} if error_row(error).http == 401 else {}


def problem(error: MetarosError) -> Response:
    """An error as a response."""
    row, body = problem_bytes(error)
    return Response(body, status_code=row.http, media_type=PROBLEM_TYPE, headers=problem_headers(error))


async def _deny(socket: WebSocket, error: MetarosError, answer: Response) -> None:
    """The problem instead of the handshake; close code 4403 from a server that cannot."""
    if "websocket.http.response" in socket.scope.get("extensions", {}):
        await socket.send_denial_response(answer)
    else:
        await socket.close(4403, error_code(error))


def install_problems(app: FastAPI) -> None:
    """Every error of every route becomes a problem document."""

    async def known(request: Request | WebSocket, error: Exception) -> Any:
        known_error = error if isinstance(error, MetarosError) else GatewayError("the gateway failed; see its log")
        answer = problem(known_error)
        if not isinstance(request, WebSocket):
            return answer
        await _deny(request, known_error, answer)  # refused before it was accepted
        return None  # what is returned would be sent a second time

    async def invalid(_request: Request, error: Exception) -> Response:
        faults = error.errors() if isinstance(error, RequestValidationError) else []
        texts = [f"{'.'.join(str(part) for part in fault['loc'])}: {fault['msg']}" for fault in faults]
        return problem(InvalidRequestError("; ".join(texts)[:1000]))

    async def http(_request: Request, error: Exception) -> Response:
        status = error.status_code if isinstance(error, HTTPException) else 500
        if status == 404:
            return problem(NotFoundError("there is nothing at this path"))
        if status == 405:
            return problem(MethodError("this path does not take that method"))
        return problem(GatewayError(str(error)))

    app.add_exception_handler(MetarosError, known)
    app.add_exception_handler(RequestValidationError, invalid)
    app.add_exception_handler(HTTPException, http)
    app.add_exception_handler(Exception, known)
