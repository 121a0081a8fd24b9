"""An answer's head and body in one write: uvicorn makes two, and each is a system call that may wake the client up."""

from __future__ import annotations

import asyncio
from typing import Any

__all__ = ["OneWrite"]


class OneWrite:
    """A connection's transport, for one answer. What is written first waits for what follows within the same step of
    the event loop; a stream whose first piece takes longer loses nothing by that.
    """

    def __init__(self, transport: asyncio.Transport, loop: asyncio.AbstractEventLoop) -> None:
        self._transport = transport
        self._loop = loop
        self._held: bytes | None = None
        self._begun = False

    def write(self, data: bytes) -> None:
        """Write, or hold for a moment."""
        if not self._begun:
            self._begun, self._held = True, data
            self._loop.call_soon(self._flush)
        elif self._held is not None:
            held, self._held = self._held, None
            self._transport.writelines((held, data) if data else (held,))
        elif data:
            self._transport.write(data)

    def close(self) -> None:
        """End the connection, once all is written."""
        self._flush()
        self._transport.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def _flush(self) -> None:
        if self._held is not None:
            held, self._held = self._held, None
            self._transport.write(held)
