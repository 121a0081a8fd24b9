"""A forward proxy that knows CONNECT and leads every name to one port of this machine."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

__all__ = ["ForwardProxy", "forward_proxy"]


@dataclass
class ForwardProxy:
    """What it was asked for."""

    target_port: int
    port: int = 0
    asked: list[str] = field(default_factory=list)

    tunnels: set[asyncio.Task[None]] = field(default_factory=set)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One tunnel."""
        task = asyncio.current_task()
        assert task is not None
        self.tunnels.add(task)
        async with contextlib.AsyncExitStack() as stack:
            stack.push_async_callback(ended, writer)
            with contextlib.suppress(OSError, asyncio.IncompleteReadError, asyncio.CancelledError):
                request = await reader.readuntil(b"\r\n\r\n")
                method, name, _ = request.split(b" ", 2)
                assert method == b"CONNECT"
                self.asked.append(name.decode())
                up_reader, up_writer = await asyncio.open_connection("127.0.0.1", self.target_port)
                stack.push_async_callback(ended, up_writer)
                writer.write(b"HTTP/1.1 200 OK\r\n\r\n")
                await asyncio.gather(copy(reader, up_writer), copy(up_reader, writer))


async def ended(writer: asyncio.StreamWriter) -> None:
    """Close a connection, and wait for its end."""
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()


async def copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Everything that comes, until the end."""
    while data := await reader.read(65536):
        writer.write(data)
        await writer.drain()
    writer.close()


@asynccontextmanager
async def forward_proxy(target_port: int) -> AsyncIterator[ForwardProxy]:
    """A listening ForwardProxy."""
    proxy = ForwardProxy(target_port)
    server = await asyncio.start_server(proxy.serve, "127.0.0.1", 0)
    proxy.port = server.sockets[0].getsockname()[1]
    try:
        yield proxy
    finally:
        server.close()
        for tunnel in proxy.tunnels:
            tunnel.cancel()
        await asyncio.gather(*proxy.tunnels, return_exceptions=True)
