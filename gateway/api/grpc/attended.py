"""Long streams: whoever opened one may lose the right to it while it is open."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from gateway.api.grpc.authenticate import Call
from metaros.limits import LIMITS

__all__ = ["attended"]

STILL_S = LIMITS.attendance_s


@contextlib.asynccontextmanager
async def attended(call: Call) -> AsyncIterator[None]:
    """While a stream is open its credential is asked again and again; CredentialsError ends it."""
    own, ended = asyncio.current_task(), list[Exception]()

    async def ask() -> None:
        while not ended:
            await asyncio.sleep(STILL_S)
            try:
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
