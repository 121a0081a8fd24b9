"""A rosbridge client that sends too much: what it is told, and how its socket ends."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

from tests.gateway.harness import ScriptedAgent, flood, hear, open_socket, running_gateway, say


@contextlib.asynccontextmanager
async def sim_1(folder: Path, **settings: Any) -> AsyncIterator[ClientConnection]:
    """A client of a gateway with one robot."""
    async with running_gateway(folder, **settings) as ready, ScriptedAgent(ready):
        async with open_socket(ready, "/rosbridge") as socket:
            yield socket


async def test_who_publishes_too_fast_is_reported_so_before_the_socket_ends(tmp_path: Path) -> None:
    one = 0.2  # a second: a burst of one
    async with sim_1(tmp_path, robot_requests_per_s=one) as socket:
        for number in range(2):
            await say(socket, op="publish", id=f"p{number}", topic="/sim_1/chat", type="std_msgs/String", msg={})
        assert (await hear(socket, "status"))["code"] == "too_many_requests"
        hearing = asyncio.create_task(all_of(socket))
        with pytest.raises(ConnectionClosed) as closed:
            await flood(socket, op="unsubscribe", topic="/sim_1/chat")
        assert closed.value.rcvd is not None
        assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1008, "too_many_requests")
        last = json.loads((await hearing)[-1])
        assert (last["op"], last["level"], last["code"]) == ("status", "error", "too_many_requests")
        assert "150 frames" in last["msg"]


async def test_who_sends_too_many_bytes_is_reported_so_too(tmp_path: Path) -> None:
    long = "a" * 900_000
    async with sim_1(tmp_path) as socket:
        hearing = asyncio.create_task(all_of(socket))
        with pytest.raises(ConnectionClosed) as closed:
            await flood(socket, at_once=6, op="unsubscribe", topic="/sim_1/chat", long=long)
        assert closed.value.rcvd is not None
        assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (4429, "too_many_requests")
        assert "1 MiB" in json.loads((await hearing)[-1])["msg"]


async def all_of(socket: ClientConnection) -> list[Any]:
    """Whatever comes until the end."""
    received = []
    with contextlib.suppress(ConnectionClosed):
        while True:
            received.append(await socket.recv())
    return received
