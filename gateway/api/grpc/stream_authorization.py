"""Ends open streams: when their caller's credential is revoked, and when the gateway drains."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from gateway.api.grpc.authenticate import Call
from gateway.errors import GatewayError
from metaros.limits import LIMITS

__all__ = ["ENDING", "DrainingError", "while_authorized"]

RECHECK_S = LIMITS.credential_check_s
POLL_S = 0.5
ENDING = "the gateway ends: come back to another one, or in a moment"


class DrainingError(GatewayError):
    """The gateway is about to end, and with it every stream; programs that try again find another one."""

    code = "not_ready"


@contextlib.asynccontextmanager
async def while_authorized(call: Call) -> AsyncIterator[None]:
    """While a stream is open its credential is checked periodically; CredentialsError or DrainingError ends it."""
    own, ended = asyncio.current_task(), list[Exception]()

    async def ask() -> None:
        asked_s = call.services.clock.monotonic_s()
        while not ended:
            await asyncio.sleep(POLL_S)
            try:
                if call.services.is_draining():
                    raise DrainingError(ENDING)
                if (now_s := call.services.clock.monotonic_s()) - asked_s >= RECHECK_S:
                    asked_s = now_s
                    await call.recheck()
            except Exception as error:
                ended.append(error)
                if own is not None:
                    own.cancel()

    asking = asyncio.create_task(ask())
    try:
        yield
    except asyncio.CancelledError:
        if ended and own is not None:
            own.uncancel()
            raise ended[0] from None
        raise
    finally:
        asking.cancel()
