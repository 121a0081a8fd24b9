"""Programs that attack a gateway, one a process.

    python -m load_tests.benchmarks.gateway.attack_programs NAME HTTP_PORT GRPC_PORT

Each goes on until it is ended, as fast as the gateway lets it, with a lower priority than the gateway and who is
measured (`os.nice`): an attacker has machines of their own, and here all share the same cores. They come from
addresses of 127.0.0.0/8, which a gateway takes for this machine: bounds by address are wider for these than for
anybody else.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import os
import struct
import sys
from collections.abc import Awaitable, Callable

import grpc
import numpy as np
import zstandard

from metaros._proto import link_pb2, link_pb2_grpc

__all__ = ["ATTACKS"]

NICE = 10
HOST = "127.0.0.1"
LOGIN = "POST /api/v1/auth/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
PASSWORD = b'{"name":"u%d","password":"wrong horse battery"}'
CONNECTIONS = 500


async def _connect(port: int, source: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    return await asyncio.open_connection(HOST, port, local_addr=(source, 0))


def _source(number: int) -> str:
    return f"127.{1 + number // 60000 % 200}.{number // 250 % 240}.{1 + number % 250}"


async def _keep(count: int, one: Callable[[int], Awaitable[None]]) -> None:
    """So many at a time, each again when it was cut off."""

    async def again(number: int) -> None:
        for turn in itertools.count():
            with contextlib.suppress(OSError, EOFError, asyncio.IncompleteReadError, ValueError):
                await one(number + turn * count)
            await asyncio.sleep(0.05)

    await asyncio.gather(*(again(number) for number in range(count)))


async def _answer(reader: asyncio.StreamReader) -> None:
    head = await reader.readuntil(b"\r\n\r\n")
    length = next((line for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:")), b":0")
    await reader.readexactly(int(length.split(b":")[1]))
    if b"connection: close" in head.lower():
        raise EOFError


async def _requests(port: int, bodies: Callable[[], bytes], *, at_a_time: int, sources: int) -> None:
    """Sign-ins one after the other on each connection."""

    async def one(number: int) -> None:
        reader, writer = await _connect(port, _source(number % sources))
        try:
            while True:
                body = bodies()
                writer.write(f"{LOGIN}Content-Length: {len(body)}\r\n\r\n".encode() + body)
                await writer.drain()
                await _answer(reader)
        finally:
            writer.close()

    await _keep(at_a_time, one)


async def login(port: int, _grpc_port: int) -> None:
    """Wrong passwords from one address, another name each time."""
    names = itertools.count()
    await _requests(port, lambda: PASSWORD % next(names), at_a_time=50, sources=1)


async def login_many(port: int, _grpc_port: int) -> None:
    """The same from 1000 addresses."""
    names = itertools.count()
    await _requests(port, lambda: PASSWORD % next(names), at_a_time=50, sources=1000)


async def json_depth(port: int, _grpc_port: int) -> None:
    """Bodies of 60,000 brackets."""
    body = b"[" * 60_000
    await _requests(port, lambda: body, at_a_time=20, sources=20)


async def slow_loris(port: int, _grpc_port: int) -> None:
    """500 connections, a byte of a head every half second."""

    async def one(number: int) -> None:
        reader, writer = await _connect(port, _source(number))
        try:
            for byte in itertools.chain(b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ", itertools.repeat(97)):
                writer.write(bytes([byte]))
                await asyncio.sleep(0.5)
                if reader.at_eof():
                    return
        finally:
            writer.close()

    await _keep(CONNECTIONS, one)


async def slow_bodies(port: int, _grpc_port: int) -> None:
    """500 connections, a byte of a body every half second."""

    async def one(number: int) -> None:
        reader, writer = await _connect(port, _source(number))
        try:
            writer.write(f"{LOGIN}Content-Length: 60000\r\n\r\n".encode())
            while not reader.at_eof():
                writer.write(b" ")
                await asyncio.sleep(0.5)
        finally:
            writer.close()

    await _keep(CONNECTIONS, one)


async def big_bodies(port: int, _grpc_port: int) -> None:
    """Endless bodies in chunks, on 20 connections."""
    chunk = b"10000\r\n" + bytes(65536) + b"\r\n"

    async def one(number: int) -> None:
        _, writer = await _connect(port, _source(number % 20))
        try:
            writer.write(f"{LOGIN}Transfer-Encoding: chunked\r\n\r\n".encode())
            while True:
                writer.write(chunk)
                await writer.drain()
        finally:
            writer.close()

    await _keep(20, one)


def _frame(opcode: int, payload: bytes) -> bytes:
    return struct.pack("!BB4s", 0x80 | opcode, 0x80 | len(payload), bytes(4)) + payload


async def _sockets(port: int, data: bytes, *, at_a_time: int) -> None:
    """The same frames again and again, and nothing is read."""

    async def one(number: int) -> None:
        reader, writer = await _connect(port, _source(number % 20))
        try:
            upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
            key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
            writer.write(f"GET /api/v1/stream HTTP/1.1\r\nHost: localhost\r\n{upgrade}{key}\r\n".encode())
            await reader.readuntil(b"\r\n\r\n")
            while not reader.at_eof():
                writer.write(data)
                await writer.drain()
        finally:
            writer.close()

    await _keep(at_a_time, one)


async def pings(port: int, _grpc_port: int) -> None:
    """20 sockets full of pings."""
    await _sockets(port, _frame(9, b"x" * 100) * 100, at_a_time=20)


async def tiny_frames(port: int, _grpc_port: int) -> None:
    """20 sockets, frames of one byte: the first starts a message, the others never end it."""
    await _sockets(port, struct.pack("!BB4sB", 0x00, 0x81, bytes(4), 97) * 500, at_a_time=20)


async def streams(_port: int, grpc_port: int) -> None:
    """Lanes that say nothing, 100 on each of 20 connections, and 20 connections that open and cancel lanes."""

    async def hoard(_number: int) -> None:
        async with _channel(grpc_port) as channel:
            calls = [link_pb2_grpc.LinkStub(channel).Connect() for _ in range(100)]
            await asyncio.gather(*(call.read() for call in calls), return_exceptions=True)

    async def reset(_number: int) -> None:
        async with _channel(grpc_port) as channel:
            for _ in range(100):
                link_pb2_grpc.LinkStub(channel).Connect().cancel()
                await asyncio.sleep(0)

    await asyncio.gather(_keep(20, hoard), _keep(20, reset))


async def bombs(_port: int, grpc_port: int) -> None:
    """A robot whose compressed batches claim 16 MiB and are more, one after the other, each on a new lane."""
    bomb = zstandard.ZstdCompressor(level=19).compress(bytes(256 * 1024 * 1024))
    lengths = np.full(64, 16 * 1024 * 1024 // 64, "<u4").tobytes()
    stamps = np.arange(64, dtype="<i8").tobytes()
    batch = link_pb2.Batch(
        stream_id=1, epoch=1, first_seq=1, count=64, stamps=stamps, lengths=lengths, payload=bomb[: 1 << 20]
    )
    batch.compression = link_pb2.COMPRESSION_ZSTD
    frame = link_pb2.AgentFrame(batches=link_pb2.Batches(batches=[batch]))

    async def one(number: int) -> None:
        async with _channel(grpc_port) as channel:
            call = link_pb2_grpc.LinkStub(channel).Connect()
            session = os.urandom(16)
            hello = link_pb2.Hello(
                protocol=1,
                robot_id=f"evil{number % 4}",
                session_id=session,
                session_number=number + 1,
                lane=link_pb2.LANE_DATA,
            )
            await call.write(link_pb2.AgentFrame(hello=hello))
            await call.read()
            with contextlib.suppress(grpc.aio.AioRpcError, asyncio.InvalidStateError):
                for _ in range(50):
                    await call.write(frame)
                await call.read()

    await _keep(4, one)


def _channel(port: int) -> grpc.aio.Channel:
    return grpc.aio.insecure_channel(f"{HOST}:{port}", options=[("grpc.use_local_subchannel_pool", 1)])


ATTACKS: dict[str, Callable[[int, int], Awaitable[None]]] = {
    "login": login,
    "login_many": login_many,
    "slow_loris": slow_loris,
    "slow_bodies": slow_bodies,
    "big_bodies": big_bodies,
    "json_depth": json_depth,
    "bombs": bombs,
    "pings": pings,
    "tiny_frames": tiny_frames,
    "streams": streams,
}


def main(name: str, port: str, grpc_port: str) -> None:
    """Attack until ended."""
    os.nice(NICE)
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_forever(ATTACKS[name](int(port), int(grpc_port))))


async def _forever(attack: Awaitable[None]) -> None:
    await attack


if __name__ == "__main__":
    main(*sys.argv[1:4])
