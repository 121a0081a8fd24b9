"""A large answer that is sent while it is made: no reader holds it up for ever, and what it took is given back."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Mapping
from typing import Protocol

from starlette.requests import Request
from starlette.responses import StreamingResponse
from starlette.types import Message, Receive, Scope, Send

from gateway.api.services import services_of
from metaros.errors import MetarosError

__all__ = ["DownloadResponse"]

STALL_S = 60.0
log = logging.getLogger(__name__)


class Pieces(Protocol):
    """What is sent: an export in the making, or a stored file."""

    def pieces(self) -> AsyncIterator[bytes]:
        """Its bytes in order."""

    def close(self) -> None:
        """Let it go; more than once does nothing."""


class DownloadResponse(StreamingResponse):
    """As fast as the client takes it; it breaks off, never ends as if whole, where the rest cannot be had."""

    def __init__(
        self,
        request: Request,
        source: Pieces,
        *,
        what: str,
        media_type: str,
        headers: Mapping[str, str],
        status_code: int = 200,
    ) -> None:
        """`what` names it in the log. It ends early when whoever asked may not have it any more."""
        pieces = services_of(request).open_connections.while_allowed(request, source.pieces())
        super().__init__(pieces, status_code=status_code, headers=headers, media_type=media_type)
        self._source = source
        self._what = what

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it, and give its place to another whatever happens."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._source.close()

    async def stream_response(self, send: Send) -> None:
        """Each piece within STALL_S."""

        async def bounded(message: Message) -> None:
            async with asyncio.timeout(STALL_S):
                await send(message)

        try:
            await super().stream_response(bounded)
        except MetarosError as error:
            log.warning("%s ended early: %s", self._what, error)
        except TimeoutError:
            log.warning("%s ended early: its reader took nothing for %.0f s", self._what, STALL_S)
