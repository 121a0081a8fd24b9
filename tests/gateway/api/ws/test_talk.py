"""The talk socket: what of a talker's packets is said, and what is answered."""

from __future__ import annotations

from typing import Any

import orjson

from gateway.api.ws import talk
from tests.gateway.cluster.test_talks import said
from tests.support.gateways.relay_rig import ROBOT, relay_rig, settle

TAKE = {"op": "take", "holder": "ann", "codec": "pcm-s16", "sample_rate": 16000}


class Socket:
    """A talker who sent all of this before anything was answered."""

    def __init__(self, *sent: dict[str, Any] | bytes) -> None:
        self._sent = list(sent)
        self.answers: list[dict[str, Any]] = []

    async def receive(self) -> dict[str, Any]:
        """The next message; they go after the last one."""
        if not self._sent:
            await settle()  # so that the robot heard them before it hears the silence
            return {"type": "websocket.disconnect"}
        one = self._sent.pop(0)
        part = {"bytes": one} if isinstance(one, bytes) else {"text": orjson.dumps(one).decode()}
        return {"type": "websocket.receive", **part}

    async def send(self, message: dict[str, Any]) -> None:
        """An answer."""
        self.answers.append(orjson.loads(message["text"]))


async def test_sound_without_the_lease_is_dropped_and_not_counted() -> None:
    sound = [bytes([number, 1]) for number in range(1, 11)]
    socket: Any = Socket(b"\0\1", TAKE, *sound, {"op": "release"}, b"\0\2", {"op": "sing"})
    async with relay_rig("a") as rig:
        await talk._TalkSocket(socket, rig["a"].talk, ROBOT).run()
        await settle()
        assert [bytes(packet.data) for packet in said(rig) if len(packet.data)] == sound
        assert {packet.codec for packet in said(rig) if len(packet.data)} == {"pcm-s16"}
    assert [(one["op"], one.get("seq")) for one in socket.answers] == [
        ("granted", None),
        ("ack", 10),
        ("released", None),
        ("error", None),
    ]


async def test_a_take_says_how_the_sound_comes() -> None:
    wrong: list[dict[str, Any]] = [{**TAKE, "codec": "mp3"}, {**TAKE, "sample_rate": 44100}]
    socket: Any = Socket(*wrong)
    async with relay_rig("a") as rig:
        await talk._TalkSocket(socket, rig["a"].talk, ROBOT).run()
    assert [(one["op"], one["code"]) for one in socket.answers] == [("error", "invalid_request")] * 2
