"""What goes out on one socket: frames made once, in order, straight into uvicorn or through ASGI, and bounded."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.websockets import WebSocket, WebSocketState
from websockets.frames import Frame, Opcode
from websockets.protocol import State
from websockets.server import ServerProtocol

from gateway.api.ws import writer as outlet
from gateway.api.ws.send_queue import SendQueue
from gateway.api.ws.writer import BINARY, TEXT, AsgiWriter, UvicornWriter, frame, split_frames
from gateway.domain.records import split_records
from metaros.clock import SystemClock
from tests.gateway.harness import DATA, ScriptedAgent, channel, hear, hear_bytes, open_socket, running_gateway, say


@given(st.sampled_from([TEXT, BINARY]), st.sampled_from([0, 1, 125, 126, 127, 65535, 65536, 70000]))
def test_a_frame_is_what_websockets_makes(opcode: int, size: int) -> None:
    payload = b"x" * size
    assert frame(opcode, payload) == Frame(Opcode(opcode), payload).serialize(mask=False)


@given(st.lists(st.tuples(st.sampled_from([TEXT, BINARY]), st.binary(max_size=300)), max_size=8))
def test_frames_are_taken_apart_again(messages: list[tuple[int, bytes]]) -> None:
    joined = b"".join(frame(opcode, payload) for opcode, payload in messages)
    assert list(split_frames(joined)) == messages


class Served(asyncio.Protocol):
    """As much of uvicorn's WebSocket protocol as an outlet looks at, over a real transport."""

    def __init__(self, made: asyncio.Queue[Served]) -> None:
        self.conn, self.writable, self.lost = ServerProtocol(), asyncio.Event(), asyncio.Event()
        self._made = made
        self.conn.state = State.OPEN
        self.writable.set()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport
        self._made.put_nowait(self)

    def pause_writing(self) -> None:
        self.writable.clear()

    def resume_writing(self) -> None:
        self.writable.set()

    def connection_lost(self, error: Exception | None) -> None:
        self.writable.set()  # as uvicorn does
        self.lost.set()


async def test_uvicorns_transport_says_when_it_is_full_and_when_it_is_gone() -> None:
    made, fulls = asyncio.Queue[Served](), list[int]()
    server = await asyncio.get_running_loop().create_server(lambda: Served(made), "127.0.0.1", 0)
    async with server, asyncio.timeout(60):
        reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
        served = await made.get()
        out = UvicornWriter(served, lambda: fulls.append(1))
        written = 0
        while out.ready():
            assert not fulls
            out.write(bytes(100_000))
            written += 100_000
        assert fulls == [1]
        await reader.readexactly(written)
        await out.drain()
        assert out.ready()
        assert fulls == [1]
        writer.transport.abort()
        await served.lost.wait()
        assert fulls == [1, 1]
        assert not out.ready()


class SlowApp:
    """An ASGI server that takes one message each time it is let."""

    def __init__(self) -> None:
        self.taken: list[Any] = []
        self.came = asyncio.Semaphore(0)
        self._let = asyncio.Semaphore(0)

    def let(self, count: int) -> None:
        for _ in range(count):
            self._let.release()

    async def send(self, message: Any) -> None:
        await self._let.acquire()
        self.taken.append(message.get("text", message.get("bytes")))
        self.came.release()

    async def receive(self) -> Any:
        await asyncio.Event().wait()

    def socket(self) -> WebSocket:
        made = WebSocket({"type": "websocket"}, self.receive, self.send)
        made.client_state = made.application_state = WebSocketState.CONNECTED
        return made


async def test_without_uvicorn_frames_go_through_asgi_in_order() -> None:
    app = SlowApp()
    send_queue, fulls, rooms = SendQueue(app.socket(), clock=SystemClock()), [], []
    send_queue.on_full, send_queue.on_drained = lambda: fulls.append(1), lambda: rooms.append(1)
    assert send_queue.ready()
    send_queue.write(frame(BINARY, bytes(70_000)) + frame(TEXT, b"two"))
    assert fulls  # at once: nobody asks before he writes
    assert not send_queue.ready()
    send_queue.text("three")
    assert send_queue.waiting_bytes > 70_000
    app.let(3)
    async with asyncio.timeout(60):
        for _ in range(3):
            await app.came.acquire()
    assert app.taken == [bytes(70_000), "two", "three"]
    await send_queue.drain()
    assert (send_queue.ready(), rooms, send_queue.waiting_bytes) == (True, [1], 0)
    send_queue.close()


async def test_who_takes_nothing_is_stalled() -> None:
    send_queue = SendQueue(SlowApp().socket(), clock=SystemClock(), stall_s=0.05)
    send_queue.write(frame(BINARY, bytes(70_000)))
    assert not send_queue.ready()
    async with asyncio.timeout(60):
        await send_queue.stalled()
    send_queue.close()


async def test_who_lets_too_many_answers_wait_is_stalled() -> None:
    send_queue = SendQueue(SlowApp().socket(), clock=SystemClock(), stall_s=600, control_bytes=1000)
    send_queue.write(frame(BINARY, bytes(70_000)))
    for _ in range(11):
        send_queue.text("x" * 100)
    async with asyncio.timeout(60):
        await send_queue.stalled()
    send_queue.close()


@pytest.mark.parametrize("known", [True, False], ids=["uvicorn", "asgi"])
async def test_the_stream_is_the_same_both_ways(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, known: bool) -> None:
    made: list[Any] = []

    def opened(socket: WebSocket, on_full: Callable[[], None]) -> Any:
        made.append(outlet.open_writer(socket, on_full) if known else AsgiWriter(socket, on_full))
        return made[-1]

    monkeypatch.setattr("gateway.api.ws.send_queue.open_writer", opened)
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/sim_1/image", "std_msgs/msg/String"))
        async with open_socket(ready, "/api/v1/stream") as viewer:
            await say(viewer, op="subscribe", id=1, robots="*", topics="/**", mode="queue")
            await say(viewer, op="no")
            await hear(viewer, "error")
            await agent.samples(1, 1, [b"a" * 100, b"b" * 100_000])
            await agent.next("ack", DATA)
            await hear(viewer, "channel")
            found: list[int] = []
            while len(found) < 2:
                found += [len(record.payload) for _, _, record in split_records(await hear_bytes(viewer))]
            assert found == [100, 100_000]
    assert isinstance(made[0], UvicornWriter if known else AsgiWriter), "no middleware may hide uvicorn's protocol"
