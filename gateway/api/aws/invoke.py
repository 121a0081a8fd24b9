"""Calls of functions over the Lambda API: waited for, put into the queue, only checked, or answered piece by piece."""

from __future__ import annotations

import base64
import binascii
from collections.abc import AsyncIterator, Mapping
from typing import Any

import orjson
from starlette.responses import Response, StreamingResponse

from gateway.api.aws.frames import EVENT_STREAM, event_frame
from gateway.automation.functions.catalogue.names import parse_function
from gateway.automation.functions.errors import NotImplementedHereError, PayloadInvalidError
from gateway.automation.functions.invoker import Stream
from gateway.automation.functions.service import Functions
from metaros.automation.functions.calls import Outcome

__all__ = ["call_function"]

REQUEST_ID, VERSION, FAILED = "x-amzn-requestid", "x-amz-executed-version", "x-amz-function-error"
CONTEXT_BYTES = 3583  # AWS's bound of a client's context, in base64
PARSED_BYTES = 64 << 10  # of a payload; a larger one would hold up all else, and is the function's runtime to read
UNHANDLED = "Unhandled"


async def call_function(
    operation: str, asked: Mapping[str, Any], services: Functions, *, trace_id: str = ""
) -> Response:
    """The answer to one of the operations that call a function.

    Raises:
        UnknownFunctionError, PayloadInvalidError, TooLargeError, ThrottledError: and nothing was called.
    """
    for name in ("TenantId", "DurableExecutionName"):
        if asked.get(name):
            raise NotImplementedHereError(f"{name} is not implemented by Meta-ROS")
    function, qualifier = parse_function(asked["FunctionName"], asked.get("Qualifier") or "")
    payload = _payload(asked.get("Payload") or asked.get("InvokeArgs") or b"")
    context = _context(asked.get("ClientContext") or "")
    kind = "Event" if operation == "InvokeAsync" else asked.get("InvocationType") or "RequestResponse"
    services.catalogue.resolve(function, qualifier)
    if kind == "DryRun":
        return Response(status_code=204)
    said = {"client_context": context, "trace_id": trace_id}
    if kind == "Event":
        request_id = await services.invoker.accept(function, qualifier, payload, **said)
        return Response(status_code=202, headers={REQUEST_ID: request_id})
    tail = asked.get("LogType") == "Tail"
    if operation == "InvokeWithResponseStream":
        stream = await services.invoker.open_stream(function, qualifier, payload, **said)
        headers = {REQUEST_ID: stream.request_id, VERSION: stream.version}
        return StreamingResponse(_frames(stream, tail=tail), media_type=EVENT_STREAM, headers=headers)
    invoked = await services.invoker.invoke(function, qualifier, payload, **said)
    outcome = invoked.outcome
    headers = {REQUEST_ID: invoked.request_id, VERSION: invoked.version}
    if not outcome.ok:
        headers[FAILED] = UNHANDLED
    if tail:
        headers["x-amz-log-result"] = base64.b64encode(outcome.log).decode()
    return Response(outcome.payload, media_type=outcome.content_type, headers=headers)


def _payload(data: bytes) -> bytes:
    """What the function gets: JSON, an empty object for nothing. Of a large one only the ends are looked at."""
    text = data.strip()
    if not text:
        return b"{}"
    try:
        if len(data) <= PARSED_BYTES:
            orjson.loads(data)
        elif text[:1] + text[-1:] not in (b"{}", b"[]", b'""'):
            raise PayloadInvalidError("Could not parse request body into json: it has no end")
    except orjson.JSONDecodeError as error:
        raise PayloadInvalidError(f"Could not parse request body into json: {error}") from error
    return data


def _context(text: str) -> str:
    """A client's context as the function is to see it: JSON."""
    if not text:
        return ""
    if len(text) > CONTEXT_BYTES:
        raise PayloadInvalidError(f"Client context has {len(text)} bytes of base64, at most {CONTEXT_BYTES} may be")
    try:
        data = base64.b64decode(text, validate=True)
        if not isinstance(orjson.loads(data), dict):
            raise PayloadInvalidError("Client context must be a JSON object in base64")
        return orjson.dumps(orjson.loads(data)).decode()
    except (binascii.Error, orjson.JSONDecodeError) as error:
        raise PayloadInvalidError(f"Client context must be a JSON object in base64: {error}") from error


async def _frames(stream: Stream, *, tail: bool) -> AsyncIterator[bytes]:
    """The pieces of an answer, then how it ended."""
    async for piece in stream.chunks:
        if isinstance(piece, Outcome):
            yield event_frame("InvokeComplete", _end(piece, tail=tail), content_type="application/json")
        elif piece:
            yield event_frame("PayloadChunk", piece, content_type="application/octet-stream")


def _end(outcome: Outcome, *, tail: bool) -> bytes:
    said: dict[str, str] = {}
    if not outcome.ok:
        said = {"ErrorCode": outcome.error_type, "ErrorDetails": outcome.payload.decode("utf-8", "replace")}
    if tail:
        said["LogResult"] = base64.b64encode(outcome.log).decode()
    return orjson.dumps(said)
