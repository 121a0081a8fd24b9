"""Bombs at the endpoints of a real gateway, which goes on to serve others."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

from metaros.limits import LIMITS
from tests.gateway.harness import ScriptedAgent, channel, client, hear, open_socket, running_gateway, say

BODIES = {
    "deep lists": b'{"topic": "/a", "type": "std_msgs/msg/String", "message": ' + b"[" * 500_000,
    "deep objects": b'{"topic": "/a", "type": "std_msgs/msg/String", "message": ' + b'{"data":' * 100_000,
    "many keys": json.dumps({"topic": "/a", "message": {f"k{n}": 1 for n in range(60_000)}}).encode(),
    "a huge number": b'{"topic": "/a", "type": "std_msgs/msg/Float64", "message": {"data": ' + b"9" * 500_000 + b"}}",
    "a huge exponent": b'{"topic": "/a", "type": "std_msgs/msg/Int64", "message": {"data": 1e999999999}}',
    "over the limit": b'{"topic": "' + b"a" * (LIMITS.json_bytes + 1) + b'"}',
}


async def overlong(socket: ClientConnection) -> None:
    """Say far too much at a time, and listen."""
    await socket.send("[" * 500_000)
    await hear(socket, "error")


async def test_bodies_and_sockets_of_a_gateway_that_goes_on_to_serve(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/sim_1/chatter", "std_msgs/msg/String"))
        for name, body in BODIES.items():
            for path in ("publish", "services/call"):
                answer = await http.post(
                    f"/api/v1/robots/sim_1/{path}", content=body, headers={"content-type": "application/json"}
                )
                assert 400 <= answer.status_code < 500, f"{name}: {answer.status_code} {answer.text[:200]}"
                assert answer.json()["code"]
        texts = ("[" * 60_000, '{"op":' * 10_000, '{"op": "subscribe", "id": 1e999}', f'"{"a" * 60_000}"')
        for path in ("/api/v1/stream", "/api/v1/robots/sim_1/teleop"):
            async with open_socket(ready, path) as socket:
                for text in texts:
                    await socket.send(text)
                    assert (await hear(socket, "error"))["code"]
                with pytest.raises(ConnectionClosed):  # larger than any request there: the socket ends
                    await overlong(socket)
        async with open_socket(ready, "/api/v1/stream") as socket:
            await say(socket, op="subscribe_fleet", id=1)
            await hear(socket, "fleet")
        robots = (await http.get("/api/v1/robots")).json()["robots"]
        assert [robot["id"] for robot in robots] == ["sim_1"]
