"""The tests' mesh keeps what the real one promises."""

from __future__ import annotations

import asyncio

import pytest

from gateway.cluster.errors import PeerGoneError, PeerRefusedError, PeerTimeoutError
from gateway.errors import RobotOfflineError
from tests.support.gateways.fake_mesh import FakeMeshes


async def turns() -> None:
    """Let what is due in the loop happen."""
    for _ in range(5):
        await asyncio.sleep(0)


async def test_gateways_hear_of_each_other() -> None:
    meshes, received = FakeMeshes(), list[tuple[str, bool]]()
    a = meshes.join("a")
    a.on_peer(lambda gateway, there: received.append((gateway, there)))
    meshes.join("b")
    await turns()
    meshes.leave("b")
    await turns()
    assert received == [("b", True), ("b", False)]
    assert a.peers() == frozenset()


async def test_messages_come_in_order_and_not_to_who_left() -> None:
    meshes, got = FakeMeshes(), list[bytes]()
    a, b = meshes.join("a"), meshes.join("b")
    b.on_message("t", lambda _sender, payload: got.append(payload))
    assert all(a.send("b", "t", bytes([number])) for number in range(5))
    assert got == []
    await turns()
    assert got == [bytes([number]) for number in range(5)]
    meshes.leave("b")
    assert not a.send("b", "t", b"x")


async def test_a_question_is_answered_refused_or_lost() -> None:
    meshes = FakeMeshes()
    a, b = meshes.join("a"), meshes.join("b")

    async def answer(sender: str, payload: bytes) -> bytes:
        if payload == b"wait":
            await asyncio.Event().wait()
        if payload == b"no":
            raise RobotOfflineError("gone")
        return sender.encode() + payload

    b.on_request("v", answer)
    assert await a.request("b", "v", b"!", timeout_s=1) == b"a!"
    with pytest.raises(RobotOfflineError, match="gone"):
        await a.request("b", "v", b"no", timeout_s=1)
    with pytest.raises(PeerRefusedError):
        await a.request("b", "other", b"", timeout_s=1)
    with pytest.raises(PeerTimeoutError):
        await a.request("b", "v", b"wait", timeout_s=0.01)
    waiting = asyncio.create_task(a.request("b", "v", b"wait", timeout_s=9))
    await turns()
    meshes.leave("b")
    with pytest.raises(PeerGoneError):
        await waiting
