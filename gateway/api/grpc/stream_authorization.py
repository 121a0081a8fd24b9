"""Long streams: whoever opened one may lose the right to it while it is open, and the gateway may end."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from gateway.api.grpc.authenticate import Call
from gateway.errors import GatewayError
from metaros.limits import LIMITS

__all__ = ["ENDING", "EndingError", "attended"]

STILL_S = LIMITS.attendance_s
LOOK_S = 0.5
ENDING = "the gateway ends: come back to another one, or in a moment"


class EndingError(GatewayError):
    """The gateway is about to end, and with it every stream; programs that try again find another one."""

    code = "not_ready"


@contextlib.asynccontextmanager
async def attended(call: Call) -> AsyncIterator[None]:
    """While a stream is open its credential is asked again and again; CredentialsError or EndingError ends it."""
    own, ended = asyncio.current_task(), list[Exception]()

    async def ask() -> None:
        asked_s = call.services.clock.monotonic_s()
        while not ended:
            await asyncio.sleep(LOOK_S)
            try:
                if call.services.operations.draining:
                    raise EndingError(ENDING)
                if (now_s := call.services.clock.monotonic_s()) - asked_s >= STILL_S:
                    asked_s = now_s
                    await call.still()
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
