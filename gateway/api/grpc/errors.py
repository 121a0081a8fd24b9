"""Errors as gRPC statuses: by the one table that REST uses, with the stable code in the trailing metadata.

The same is in the status details, as google.rpc knows them: ErrorInfo with the code as its reason, BadRequest where a
field is at fault, RetryInfo where it says when to come back.
"""

from __future__ import annotations

import asyncio
import math
from typing import Any, NoReturn

import grpc
from google.protobuf.any_pb2 import Any as Packed
from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import Message
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, RetryInfo
from google.rpc.status_pb2 import Status

from gateway.api.grpc.fields import FieldFaultError
from gateway.api.problem import error_code
from gateway.errors import GatewayError, LeaseTakenError, RequestError, TooManyRequestsError, error_row
from metaros.errors import MetarosError

__all__ = ["CODE_KEY", "StalledError", "refuse", "status_of"]

CODE_KEY = "metaros-code"
DETAILS_KEY = "grpc-status-details-bin"
DOMAIN = "metaros"
DETAIL_CHARS = 1000
ABORT_S = 2.0  # who takes nothing does not take the status either: then the call is dropped


class StalledError(RequestError):
    """A stream's reader took nothing for too long."""

    code = "stalled"


def status_of(error: MetarosError) -> grpc.StatusCode:
    """The status of an error's row."""
    found: grpc.StatusCode = getattr(grpc.StatusCode, error_row(error).grpc)
    return found


def trailing(error: MetarosError, text: str) -> tuple[tuple[str, str | bytes], ...]:
    """What a client's program goes by: the code, what comes with some of them, and all of it as status details."""
    pairs: list[tuple[str, str | bytes]] = [(CODE_KEY, error_code(error))]
    if isinstance(error, LeaseTakenError):
        pairs.append(("metaros-holder", printable(error.holder)))
    if isinstance(error, TooManyRequestsError):
        pairs.append(("retry-after", str(max(1, math.ceil(error.retry_after_s)))))
    code, _ = status_of(error).value
    status = Status(code=code, message=text, details=[packed(item) for item in details(error)])
    return (*pairs, (DETAILS_KEY, status.SerializeToString()))


def details(error: MetarosError) -> list[Message]:
    """The error in the words of google.rpc."""
    found: list[Message] = [ErrorInfo(reason=error_code(error), domain=DOMAIN)]
    if isinstance(error, LeaseTakenError):
        found = [ErrorInfo(reason=error_code(error), domain=DOMAIN, metadata={"holder": error.holder[:128]})]
    if isinstance(error, FieldFaultError):
        fault = BadRequest.FieldViolation(field=error.field, description=str(error)[:DETAIL_CHARS])
        found.append(BadRequest(field_violations=[fault]))
    if isinstance(error, TooManyRequestsError):
        delay = Duration()
        delay.FromMilliseconds(math.ceil(error.retry_after_s * 1000))
        found.append(RetryInfo(retry_delay=delay))
    return found


def packed(message: Message) -> Packed:
    """A message as one of the details."""
    made = Packed()
    made.Pack(message)
    return made


async def refuse(context: grpc.aio.ServicerContext[Any, Any], error: Exception) -> NoReturn:
    """End the call with the error; one that is none of ours tells nothing of itself."""
    known = error if isinstance(error, MetarosError) else GatewayError("the gateway failed; see its log")
    text = str(known)[:DETAIL_CHARS]
    async with asyncio.timeout(ABORT_S if isinstance(known, StalledError) else None):
        await context.abort(status_of(known), text, trailing_metadata=trailing(known, text))


def printable(text: str) -> str:
    """ASCII as metadata takes it."""
    return "".join(letter if " " <= letter <= "~" else "?" for letter in text)[:128]
