"""The simulator's own HTTP/2 beside a real gRPC server: whole messages both ways, windows, callbacks."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import grpc
import pytest

from load_tests.fleet.http2 import Http2Lane, open_http2
from load_tests.fleet.lanes import LaneCallbacks, Traffic

LARGE = 3 * 1024 * 1024


class Echo:
    """Sends every message back, until one says stop."""

    def __init__(self) -> None:
        self.read = asyncio.Event()
        self.read.set()

    async def connect(self, request_iterator: AsyncIterator[bytes], context: Any) -> None:
        await self.read.wait()
        async for message in request_iterator:
            if message == b"stop":
                return
            await context.write(message)


@asynccontextmanager
async def serving() -> AsyncIterator[tuple[Echo, int]]:
    """A real gRPC server with the link's method."""
    echo, server = Echo(), grpc.aio.server(options=[("grpc.max_receive_message_length", 2 * LARGE)])
    handler = grpc.stream_stream_rpc_method_handler(echo.connect)
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("metaros.v1.Link", {"Connect": handler}),))
    port = server.add_insecure_port("127.0.0.1:0")
    await server.start()
    try:
        yield echo, port
    finally:
        await server.stop(0)


class Received:
    """What a lane told."""

    def __init__(self) -> None:
        self.frames: asyncio.Queue[bytes] = asyncio.Queue()
        self.over: asyncio.Queue[str] = asyncio.Queue()
        self.room = asyncio.Event()
        self.traffic = Traffic()

    async def open(self, port: int) -> Http2Lane:
        callbacks = LaneCallbacks(self.frames.put_nowait, self.over.put_nowait, self.room.set)
        return await open_http2("127.0.0.1", port, callbacks, self.traffic)


async def test_messages_of_any_size_cross_both_ways() -> None:
    received = Received()
    async with asyncio.timeout(30), serving() as (_, port):
        lane = await received.open(port)
        for size in (0, 1, 16_383, 16_384, 100_000, LARGE):
            lane.write(bytes(size))
            assert len(await received.frames.get()) == size
        lane.ping()
        lane.ping()
        lane.write(b"still here")
        assert await received.frames.get() == b"still here"
        assert received.traffic.sent_frames == received.traffic.received_frames == 7
        assert received.traffic.sent_bytes > LARGE
        lane.close()


async def test_who_is_not_read_has_to_wait() -> None:
    received = Received()
    async with asyncio.timeout(30), serving() as (echo, port):
        echo.read.clear()
        lane = await received.open(port)
        lane.write(bytes(LARGE))
        assert lane.full
        echo.read.set()
        assert len(await received.frames.get()) == LARGE
        await received.room.wait()
        assert not lane.full
        lane.close()


async def test_the_end_of_a_stream_is_reported_once() -> None:
    received = Received()
    async with asyncio.timeout(30), serving() as (_, port):
        lane = await received.open(port)
        lane.write(b"stop")
        assert "ended the stream" in await received.over.get()
        lane.write(b"nobody hears this")
        lane.close()
    await asyncio.sleep(0)
    assert received.over.empty()


async def test_a_closed_lane_tells_nothing() -> None:
    received = Received()
    async with asyncio.timeout(30), serving() as (_, port):
        lane = await received.open(port)
        lane.close()
        await asyncio.sleep(0)
    assert received.over.empty()


async def test_nobody_there_is_an_os_error() -> None:
    from tests.support.ports import free_port

    with pytest.raises(OSError):
        await Received().open(free_port())
