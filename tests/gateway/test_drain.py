"""The gateway's end: first not ready, then robots and sockets are told, and what is under way is finished."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from gateway.main import Ready, serve
from gateway.settings import Settings
from metaros.errors import ConfigError
from tests.gateway.harness import CONTROL, OPERATOR_KEY, RING, ScriptedAgent, client, hear, open_socket

BODY = b'{"topic": "/odom"}'


@asynccontextmanager
async def ending_gateway(folder: Path, **settings: Any) -> AsyncIterator[tuple[Ready, asyncio.Event, Any]]:
    """A gateway, what makes it end, and its task."""
    stop, up = asyncio.Event(), asyncio.get_running_loop().create_future()
    free = {"port": 0, "grpc_port": 0, "api_grpc_port": 0, "foxglove_port": 0, "rosbridge_port": 0}
    task = asyncio.create_task(
        serve(Settings(**{**free, "data_dir": folder, **settings}), stop, on_ready=up.set_result, authenticator=RING)
    )
    await asyncio.wait({task, up}, return_when=asyncio.FIRST_COMPLETED)
    try:
        yield up.result(), stop, task
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


async def until(condition: Callable[[], Awaitable[bool]]) -> None:
    """Return as soon as it is so."""
    for _ in range(6000):
        if await condition():
            return
        await asyncio.sleep(0.01)
    raise AssertionError("not so within a minute")


async def refused(ready: Ready) -> bool:
    """Whether nobody is let in any more."""
    try:
        _, writer = await asyncio.open_connection("127.0.0.1", ready.http_port)
    except ConnectionRefusedError:
        return True
    writer.close()
    return False


async def test_it_is_not_ready_at_first_and_goes_on(tmp_path: Path) -> None:
    async with ending_gateway(tmp_path, drain_notice_s=600.0) as (ready, stop, task):
        async with client(ready) as http, open_socket(ready, "/api/v1/stream") as socket:
            await hear(socket, "welcome")
            assert (await http.get("/readyz")).status_code == 200
            stop.set()

            async def draining() -> bool:
                return (await http.get("/readyz")).status_code == 503

            await until(draining)
            assert (await http.get("/readyz")).json()["checks"]["end"] == "draining"
            assert (await http.get("/healthz")).status_code == 200
            assert "metaros_draining 1.0" in (await http.get("/metrics")).text
            await socket.send('{"op": "subscribe_fleet", "id": 1}')
            await hear(socket, "fleet")
            async with ScriptedAgent(ready):
                pass
            assert not task.done()


async def test_robots_hear_goodbye_sockets_1001_and_a_request_under_way_is_answered(tmp_path: Path) -> None:
    async with ending_gateway(tmp_path, drain_s=60.0) as (ready, stop, task):
        async with ScriptedAgent(ready) as agent, open_socket(ready, "/api/v1/stream") as socket:
            await hear(socket, "welcome")
            reader, writer = await asyncio.open_connection("127.0.0.1", ready.http_port)
            head = f"POST /api/v1/robots/sim_1/publish HTTP/1.1\r\nhost: 127.0.0.1:{ready.http_port}\r\n"
            head += f"authorization: Bearer {OPERATOR_KEY}\r\ncontent-type: application/json\r\n"
            writer.write(f"{head}content-length: {len(BODY)}\r\n\r\n".encode() + BODY[:5])
            async with client(ready) as http:
                await until(lambda: busy(http))
            stop.set()
            goodbye = (await agent.next("goodbye", CONTROL)).goodbye
            assert (goodbye.code, goodbye.retry_after_ms) == ("shutting_down", 200)
            await asyncio.wait_for(socket.wait_closed(), 60)
            assert socket.close_code == 1001
            await until(lambda: refused(ready))
            assert not task.done()
            writer.write(BODY[5:])
            answer = await asyncio.wait_for(reader.read(), 60)
            assert b"robot_offline" in answer, "it went with the Goodbye, and the answer says so"
            writer.close()
        await asyncio.wait_for(task, 60)


async def test_a_command_under_way_gets_its_result_before_its_robot_is_sent_away(tmp_path: Path) -> None:
    async with ending_gateway(tmp_path, drain_s=60.0) as (ready, stop, task):
        async with ScriptedAgent(ready) as agent, client(ready) as http:
            order = {"kind": "set_uplink", "request": {"bytes_per_s": 5000}}
            running = asyncio.ensure_future(http.post("/api/v1/robots/sim_1/commands", json=order))
            command = (await agent.next("command", CONTROL)).command
            stop.set()

            async def draining() -> bool:
                return (await http.get("/readyz")).status_code == 503

            await until(draining)
            await agent.answer(command)
            assert (await running).json()["state"] == "done"
            assert (await agent.next("goodbye", CONTROL)).goodbye.code == "shutting_down"
        await asyncio.wait_for(task, 60)


async def busy(http: Any) -> bool:
    """Whether another connection than the stream's and ours is there: its request has begun."""
    return "metaros_connections 3.0" in (await http.get("/metrics")).text


async def test_what_is_not_finished_in_time_is_cut(tmp_path: Path) -> None:
    async with ending_gateway(tmp_path, drain_s=0.0) as (ready, stop, task):
        _, writer = await asyncio.open_connection("127.0.0.1", ready.http_port)
        head = f"POST /api/v1/robots/sim_1/publish HTTP/1.1\r\nhost: 127.0.0.1:{ready.http_port}\r\n"
        writer.write(f"{head}authorization: Bearer {OPERATOR_KEY}\r\ncontent-length: 9\r\n\r\n".encode())
        await writer.drain()
        stop.set()
        await asyncio.wait_for(task, 60)
        writer.close()


@pytest.mark.parametrize("settings", [{"drain_s": -1.0}, {"drain_notice_s": 601.0}, {"drain_s": float("nan")}])
def test_a_bound_that_is_none_is_refused(settings: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="drain"):
        Settings(**settings)  # type: ignore[arg-type]
