"""Talking through a running agent: its own lease, its bounds, the empty packet that ends it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import pytest

from edge_agent.commands.talk_watchdog import TALK_TYPE, TalkGuard
from edge_agent.errors import PacketError, TalkOffError
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import ManualClock, SystemClock
from metaros.idl import type_hash
from metaros.interfaces.metaros_msgs.msg import AudioPacket
from metaros.limits import LIMITS
from tests.edge_agent.conftest import Rig, Robot
from tests.support.waiting import wait_until_async

TOPIC = "/sim_1/speaker/talk"
WORD = b"\x01\x02" * 320


def packed(sound: bytes = WORD) -> bytes:
    message = AudioPacket(codec="pcm-s16", sample_rate=16000, channels=1, samples=len(sound) // 2, data=sound)
    return codec(AudioPacket).encode(message)


def grant(rig: Rig, lease: str = "T", valid_ms: int = 60_000) -> bytes:
    return rig.command(grant_talk=link_pb2.GrantLease(lease_id=lease, holder="ann", valid_ms=valid_ms))


def say(rig: Rig, seq: int, *, lease: str = "T", age_s: float = 0.0, payload: bytes = b"") -> None:
    talk = link_pb2.Teleop(
        lease_id=lease,
        seq=seq,
        sent_ns=SystemClock().wall_ns() - round(age_s * 1e9),
        topic=TOPIC,
        type_name=TALK_TYPE,
        type_hash=type_hash(TALK_TYPE),
        payload=payload or packed(),
    )
    rig.gateway.say(link_pb2.GatewayFrame(talk=talk))


async def until_received(rig: Rig, heard: list[bytes], seqs: Iterator[int], *, lease: str = "T") -> None:
    """As a voice does: what a busy machine delivers late is too old to be played."""
    count = len([sound for sound in heard if sound])
    await wait_until_async(
        lambda: say(rig, next(seqs), lease=lease) or len([s for s in heard if s]) > count, every_s=0.1
    )


@pytest.fixture
def heard(robot: Robot) -> list[bytes]:
    """The sound that reaches the robot's speaker."""
    sounds: list[bytes] = []
    robot.node.create_subscription(AudioPacket, "speaker/talk", lambda m: sounds.append(bytes(m.data)), 50)
    return sounds


async def test_speech_needs_its_own_lease_and_ends_with_silence(agent: Rig, heard: list[bytes]) -> None:
    seqs = itertools.count(1)
    drive = agent.command(grant_lease=link_pb2.GrantLease(lease_id="D", holder="bob", valid_ms=60_000))
    assert (await agent.result(drive)).ok
    say(agent, next(seqs), lease="D")  # who drives may not talk for that
    assert (await agent.result(grant(agent))).ok
    await until_received(agent, heard, seqs)
    assert heard[0] == WORD
    await wait_until_async(lambda: heard[-1] == b"")  # no packet came any more
    await until_received(agent, heard, seqs)
    release = agent.command(release_talk=link_pb2.ReleaseLease(lease_id="T"))
    assert (await agent.result(release)).ok
    await wait_until_async(lambda: heard[-1] == b"")
    count = len(heard)
    say(agent, next(seqs))
    assert (await agent.result(grant(agent, "U"))).ok  # it came after what was said without a lease
    await until_received(agent, heard, itertools.count(1), lease="U")
    assert heard[count] == WORD
    assert heard.count(WORD) <= count + 5


async def test_a_plain_publish_is_refused_without_the_lease(agent: Rig, heard: list[bytes]) -> None:
    message = link_pb2.PublishMessage(
        topic=TOPIC, type_name=TALK_TYPE, type_hash=type_hash(TALK_TYPE), payload=packed()
    )
    assert (await agent.result(agent.command(publish=message))).code == "lease_required"
    assert (await agent.result(agent.command(publish=message, durable=True))).code == "lease_required"
    assert heard == []


def test_packets_have_a_size_a_type_and_a_rate() -> None:
    clock = ManualClock()
    guard = TalkGuard(clock)
    with pytest.raises(PacketError, match="at most"):
        guard.admit(TALK_TYPE, bytes(LIMITS.talk_packet_bytes + 200))
    with pytest.raises(PacketError, match="not std_msgs"):
        guard.admit("std_msgs/msg/String", b"")

    def admitted() -> int:
        for count in range(1000):
            try:
                guard.admit(TALK_TYPE, b"")
            except PacketError:
                return count
        return 1000

    assert admitted() == LIMITS.talk_packets_per_s / 2
    clock.advance(0.1)
    assert admitted() == LIMITS.talk_packets_per_s / 10


def test_a_robot_that_lets_nobody_talk() -> None:
    guard = TalkGuard(ManualClock(), on=False)
    with pytest.raises(TalkOffError):
        guard.grant("T", 3.0)
    assert guard.is_actuator("/r1/speaker/talk")  # so that no other door is open
    assert not guard.holds("T")
