"""Errors as gRPC statuses: by the one table that REST uses, with the stable code in the trailing metadata."""

from __future__ import annotations

import math
from typing import Any, NoReturn

import grpc

from gateway.api.problem import error_code
from gateway.errors import GatewayError, LeaseTakenError, TooManyRequestsError, error_row
from metaros.errors import MetarosError

__all__ = ["CODE_KEY", "refuse", "status_of"]

CODE_KEY = "metaros-code"
DETAIL_CHARS = 1000


def status_of(error: MetarosError) -> grpc.StatusCode:
    """The status of an error's row."""
    found: grpc.StatusCode = getattr(grpc.StatusCode, error_row(error).grpc)
    return found


def trailing(error: MetarosError) -> tuple[tuple[str, str], ...]:
    """What a client's program goes by: the code, and what comes with some of them."""
    pairs = [(CODE_KEY, error_code(error))]
    if isinstance(error, LeaseTakenError):
        pairs.append(("metaros-holder", printable(error.holder)))
    if isinstance(error, TooManyRequestsError):
        pairs.append(("retry-after", str(max(1, math.ceil(error.retry_after_s)))))
    return tuple(pairs)


async def refuse(context: grpc.aio.ServicerContext[Any, Any], error: Exception) -> NoReturn:
    """End the call with the error; one that is none of ours tells nothing of itself."""
    known = error if isinstance(error, MetarosError) else GatewayError("the gateway failed; see its log")
    await context.abort(status_of(known), str(known)[:DETAIL_CHARS], trailing_metadata=trailing(known))


def printable(text: str) -> str:
    """ASCII as metadata takes it."""
    return "".join(letter if " " <= letter <= "~" else "?" for letter in text)[:128]
