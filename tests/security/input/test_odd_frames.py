"""Sockets of people: what is no request, too much, or about robots that one does not see, ends nothing but itself."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.principal import Role
from tests.gateway.harness import ScriptedAgent, hear, open_socket, running_gateway, say
from tests.support.gateways.memory_authenticator import KeyRing

TOGETHER = 8  # on one socket: it may have only so many subscriptions
HALF = '"\\ud800"'  # half of a character: JSON can say it, UTF-8 cannot
ODD: list[Any] = ["\0", "\x1b[2J", [], {}, None, True, -1, 10**40, "9" * 5000]
RAW = ["1", "[]", "null", '"x"', "{}", '{"op":' + HALF + "}", '{"op":NaN}', "[" * 5000, '{"op":"subscribe","id":1e400}']
STREAM = (
    {"op": "subscribe", "id": 1, "robots": "**", "topics": "**"},
    {"op": "subscribe_metrics", "id": 2, "robots": "*"},
)
DRIVE = (
    {"op": "take", "holder": "ada"},
    {"op": "drive", "seq": 1, "linear": [0, 0, 0], "angular": [0, 0, 0]},
    {"op": "stop"},
)


def frames(*plain: dict[str, Any]) -> list[str]:
    """Each request with each odd value in each field, and what is no request."""
    made = list(RAW)
    for request in plain:
        for name in request:
            made += [json.dumps({**request, name: odd}) for odd in ODD]
            made.append(json.dumps({**request, name: "@"}).replace('"@"', HALF))
            made.append(json.dumps({**request, name: 0}).replace(f'"{name}": 0', f'"{name}": NaN'))
    return made


@asynccontextmanager
async def granting(agent: ScriptedAgent) -> AsyncIterator[None]:
    """A robot that does what it is told: whoever takes it, drives it."""

    async def obey() -> None:
        while True:
            await agent.answer((await agent.next("command", timeout_s=3600)).command)

    task = asyncio.create_task(obey())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@pytest.mark.parametrize(
    ("path", "plain"), [("/api/v1/stream", STREAM), ("/api/v1/robots/sim_1/teleop", DRIVE)], ids=["stream", "teleop"]
)
async def test_an_odd_frame_ends_nothing_but_itself(
    tmp_path: Path, path: str, plain: tuple[Any, ...], caplog: Any
) -> None:
    odd = frames(*plain)
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent, granting(agent):
        for first in range(0, len(odd), TOGETHER):
            async with open_socket(ready, path) as socket:
                for number, frame in enumerate(odd[first : first + TOGETHER], 1000):
                    await socket.send(frame)
                    if path.endswith("stream"):
                        await say(socket, op="subscribe_fleet", id=number)
                        while (await hear(socket, "fleet"))["id"] != number:  # an earlier one's may be on its way
                            pass
                        await say(socket, op="unsubscribe", id=number)
                    else:
                        await say(socket, op="release")
                        assert await hear(socket, "released"), frame
    failed = [record.getMessage() for record in caplog.records if record.exc_info and record.name != "asyncio"]
    assert failed == []


async def test_a_socket_that_drives_a_robot_out_of_scope_is_not_there(tmp_path: Path) -> None:
    ring = KeyRing()
    key = ring.add(role=Role.OPERATOR, robots=("lab_*",))
    async with running_gateway(tmp_path, authenticator=ring) as ready:
        async with (
            ScriptedAgent(ready, "hall_1") as hidden,
            ScriptedAgent(ready, "lab_1", session=b"l" * 16) as seen,
            granting(seen),
        ):
            for robot in ("hall_1", "hall_2"):
                with pytest.raises(Exception, match="404"):
                    await open_socket(ready, f"/api/v1/robots/{robot}/teleop", key=key)
            async with open_socket(ready, "/api/v1/robots/lab_1/teleop", key=key) as socket:
                for robot in ("hall_1", "../hall_1"):  # what a frame says about a robot counts for nothing
                    await say(socket, op="take", holder="eve", robot=robot, robot_id=robot)
                await say(socket, op="release")
                await hear(socket, "released")
            while not hidden.frames[1].empty():
                assert hidden.frames[1].get_nowait().WhichOneof("frame") not in ("teleop", "command")
