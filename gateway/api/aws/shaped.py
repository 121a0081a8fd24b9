"""Refusals in the form that AWS's clients know: a header that names the error, and its members. Pure ASGI.

Outside of everything that may refuse, the guard included, so that every problem document of `/lambda` becomes an error
that boto3 raises by its name.
"""

from __future__ import annotations

import secrets
import uuid
from typing import Any

import orjson
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.api.aws.errors import AwsError, aws_error
from gateway.api.aws.prefix import is_lambda
from gateway.api.problem import PROBLEM_TYPE
from gateway.automation.functions.catalogue.shapes import model

__all__ = ["REASON_KEY", "Shaped"]

REASON_KEY = "metaros.lambda.reason"  # of a scope: why a call is throttled, in AWS's words
RETRY_S = b"1"  # after a call that found no worker
REQUEST_ID = b"x-amzn-requestid"
_DROPPED = (b"content-type", b"content-length", b"www-authenticate")


class Shaped:
    """Makes AWS's errors of problem documents, and gives every answer a request's id."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on."""
        if scope["type"] != "http" or not is_lambda(scope["path"]):
            await self._app(scope, receive, send)
            return
        held: Message | None = None

        async def shaped(message: Message) -> None:
            nonlocal held
            if message["type"] == "http.response.start":
                message = _numbered(message)
                if (b"content-type", PROBLEM_TYPE.encode()) in message["headers"]:
                    held = message
                    return
            elif held is not None:
                start, held = held, None
                start, message = _error(scope, start, message)
                await send(start)
            await send(message)

        await self._app(scope, receive, shaped)


def _numbered(start: Message) -> Message:
    headers = list(start.get("headers", ()))
    if all(name != REQUEST_ID for name, _ in headers):
        headers.append((REQUEST_ID, str(uuid.UUID(bytes=secrets.token_bytes(16), version=4)).encode()))
    return {**start, "headers": headers}


def _error(scope: Scope, start: Message, message: Message) -> tuple[Message, Message]:
    problem: dict[str, Any] = orjson.loads(message["body"])
    error = aws_error(problem["code"], start["status"])
    body = orjson.dumps(_members(error, problem, scope))
    headers = [(name, value) for name, value in start["headers"] if name not in _DROPPED]
    headers += [
        (b"x-amzn-errortype", error.name.encode()),
        (b"content-type", b"application/json"),
        (b"content-length", str(len(body)).encode()),
    ]
    if error.status == 429 and all(name != b"retry-after" for name, _ in headers):
        headers.append((b"retry-after", RETRY_S))
    return {**start, "status": error.status, "headers": headers}, {**message, "body": body}


def _members(error: AwsError, problem: dict[str, Any], scope: Scope) -> dict[str, str]:
    """As the model has them, which spells one member in two ways; errors of all services have only a message."""
    said = problem["detail"] or problem["title"]
    shape: Any = model().shape_for(error.name) if error.name in model().shape_names else None
    known = shape.members if shape is not None else ("message",)
    members = {name: said for name in known if name.lower() == "message"}
    if "Type" in known:
        members["Type"] = "User" if error.status < 500 else "Service"
    if "Reason" in known:
        members["Reason"] = scope.get(REASON_KEY, "CallerRateLimitExceeded")
    return members
