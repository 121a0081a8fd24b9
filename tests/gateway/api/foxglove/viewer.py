"""A small Foxglove client for tests: it speaks the protocol and keeps what it hears."""

from __future__ import annotations

import asyncio
import json
import struct
from typing import Any

from websockets.asyncio.client import ClientConnection, connect

from gateway.main import Ready
from tests.gateway.harness import OPERATOR_KEY

__all__ = ["PROTOCOL", "Viewer", "viewing"]

PROTOCOL = "foxglove.sdk.v1"


class Viewer:
    """One connection; messages that nobody waited for stay in order."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.channels: dict[str, dict[str, Any]] = {}
        self.services: dict[str, dict[str, Any]] = {}

    async def say(self, op: str, **fields: Any) -> None:
        """Send a JSON request."""
        await self.socket.send(json.dumps({"op": op, **fields}))

    async def next(self) -> dict[str, Any] | bytes:
        """The next message; channels and services that come are noted."""
        async with asyncio.timeout(60):
            message = await self.socket.recv()
        if isinstance(message, bytes):
            return message
        said: dict[str, Any] = json.loads(message)
        for channel in said.get("channels", ()):
            self.channels[channel["topic"]] = channel
        for service in said.get("services", ()):
            self.services[service["name"]] = service
        return said

    async def hear(self, op: str) -> dict[str, Any]:
        """The next JSON message with that op."""
        while True:
            said = await self.next()
            if isinstance(said, dict) and said["op"] == op:
                return said

    async def data(self) -> tuple[int, int, bytes]:
        """The next sample: subscription, time in ns, payload."""
        while True:
            said = await self.next()
            if isinstance(said, bytes) and said[0] == 1:
                number, stamp_ns = struct.unpack_from("<IQ", said, 1)
                return number, stamp_ns, said[13:]

    async def binary(self, opcode: int) -> bytes:
        """The next binary message with that opcode, without it."""
        while True:
            said = await self.next()
            if isinstance(said, bytes) and said[0] == opcode:
                return said[1:]

    async def channel(self, topic: str) -> dict[str, Any]:
        """The channel of that topic, as soon as it is advertised."""
        while topic not in self.channels:
            await self.next()
        return self.channels[topic]

    async def subscribe(self, number: int, topic: str) -> None:
        """Subscribe to a topic under that number."""
        channel = await self.channel(topic)
        await self.say("subscribe", subscriptions=[{"id": number, "channelId": channel["id"]}])


class viewing:
    """`async with viewing(ready, "/sim_1") as viewer:` on Foxglove's own port."""

    def __init__(self, ready: Ready, path: str = "/", *, key: str = OPERATOR_KEY, **options: Any) -> None:
        token = f"{'&' if '?' in path else '?'}token={key}" if key else ""
        options = {"subprotocols": [PROTOCOL], "proxy": None, "max_size": None, "compression": None, **options}
        self._connect = connect(f"ws://127.0.0.1:{ready.foxglove_port}{path}{token}", **options)

    async def __aenter__(self) -> Viewer:
        self._socket = await self._connect
        return Viewer(self._socket)

    async def __aexit__(self, *_exc: object) -> None:
        await self._socket.close()
