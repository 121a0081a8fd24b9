"""Talking over several gateways, beside whoever drives: the same leases, of another kind."""

from __future__ import annotations

import pytest

from gateway.errors import InvalidRequestError, LeaseRequiredError, LeaseTakenError
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.interfaces.metaros_msgs.msg import AudioPacket
from metaros.limits import LIMITS
from tests.support.gateways.relay_rig import ROBOT, RelayRig, relay_rig, settle

AUDIO = "metaros_msgs/msg/AudioPacket"


def said(rig: RelayRig) -> list[AudioPacket]:
    return [codec(AudioPacket).decode(frame.talk.payload) for frame in rig.frames if frame.HasField("talk")]


async def test_somebody_talks_from_a_gateway_that_has_not_the_link_while_another_drives() -> None:
    async with relay_rig("abc") as rig:
        drive = await rig["c"].teleop.take(ROBOT, "bob")
        talk = await rig["b"].talk.take(ROBOT, "ann")
        await settle()
        grants = [frame.command.grant_talk for frame in rig.frames if frame.command.HasField("grant_talk")]
        assert [(grant.lease_id, grant.holder) for grant in grants] == [(talk.lease_id, "ann")]
        for _ in range(3):
            await rig["b"].talk.say(talk, b"\x01\x02", coding="pcm-s16", sample_rate=16000)
            await rig["c"].teleop.drive(drive, linear=0.5, angular=0.1)
            await settle()
            rig.clock.advance(LIMITS.lease_s - 0.1)
        assert [(packet.codec, packet.sample_rate, packet.channels, packet.samples) for packet in said(rig)] == [
            ("pcm-s16", 16000, 1, 1)
        ] * 3
        assert {frame.talk.topic for frame in rig.frames if frame.HasField("talk")} == {f"/{ROBOT}/speaker/talk"}
        await rig["b"].talk.release(talk)
        await settle()
        assert len(said(rig)[-1].data) == 0  # silence at once
        assert rig.frames[-1].command.release_talk.lease_id == talk.lease_id
        assert rig["a"].leases.holder_of(ROBOT, now_s=rig.clock.monotonic_s()) is not None  # bob drives on


@pytest.mark.parametrize(("first", "second"), [("a", "b"), ("b", "a"), ("b", "c"), ("b", "b")])
async def test_nobody_talks_beside_another_one(first: str, second: str) -> None:
    async with relay_rig("abc") as rig:
        talk = await rig[first].talk.take(ROBOT, "ann")
        with pytest.raises(LeaseTakenError, match="is talking through") as caught:
            await rig[second].talk.take(ROBOT, "bob")
        assert caught.value.holder == "ann"
        await rig[first].talk.release(talk)
        assert (await rig[second].talk.take(ROBOT, "bob")).holder == "bob"


async def test_a_talk_that_lapsed_while_another_took_it_is_lost() -> None:
    async with relay_rig("a") as rig:
        talk = await rig["a"].talk.take(ROBOT, "ann")
        rig.clock.advance(LIMITS.lease_s + 0.1)
        await rig["a"].talk.take(ROBOT, "bob")
        with pytest.raises(LeaseTakenError):
            await rig["a"].talk.say(talk, b"\x01\x02", coding="pcm-s16", sample_rate=16000)
        assert said(rig) == []


async def test_the_topic_is_shut_to_plain_publishing_and_to_who_drives() -> None:
    async with relay_rig("a") as rig:
        fleet, packet = rig["a"].fleet, {"codec": "opus"}
        drive = await rig["a"].teleop.take(ROBOT, "bob")
        for lease_id in ("", drive.lease_id):
            with pytest.raises(LeaseRequiredError, match="talk lease"):
                await fleet.publishing(ROBOT, "speaker/talk", type_name=AUDIO, message=packet, lease_id=lease_id)
        talk = await rig["a"].talk.take(ROBOT, "ann")
        command = await fleet.publishing(ROBOT, "speaker/talk", type_name=AUDIO, message=packet, lease_id=talk.lease_id)
        assert isinstance(command, link_pb2.Command)
        assert not fleet.is_actuator(ROBOT, "speaker/talk")  # so that no door takes the wheel for it


@pytest.mark.parametrize(
    ("sound", "coding", "rate"),
    [
        (b"", "opus", 48000),
        (bytes(LIMITS.talk_packet_bytes + 2), "opus", 48000),
        (b"abc", "pcm-s16", 16000),
        (b"ab", "mp3", 16000),
        (b"ab", "pcm-s16", 44100),
    ],
)
async def test_what_is_no_packet_is_refused(sound: bytes, coding: str, rate: int) -> None:
    async with relay_rig("a") as rig:
        talk = await rig["a"].talk.take(ROBOT, "ann")
        with pytest.raises(InvalidRequestError):
            await rig["a"].talk.say(talk, sound, coding=coding, sample_rate=rate)
        assert said(rig) == []
