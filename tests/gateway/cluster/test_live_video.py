"""Video between gateways: whole groups, also where some were lost between, and key frames for viewers elsewhere."""

from __future__ import annotations

from dataclasses import replace

from gateway.domain.channel import Channel
from tests.gateway.cluster.test_live import known, wanted
from tests.support.devices.video import COMPRESSED_VIDEO, access_units, video_message
from tests.support.gateways.fake_mesh import FakeMeshes
from tests.support.gateways.mirrored import Replica, channel, make_run, replicas
from tests.support.waiting import wait_until_async

MESSAGES = [video_message(unit) for unit in access_units(24, group=6)]
STEP_NS = 100_000_000


def video() -> Channel:
    return replace(channel("r1", 1, "/video"), schema_name=COMPRESSED_VIDEO)


def publish(replica: Replica, of: Channel, *numbers: int) -> None:
    for number in numbers:
        run = make_run(of, [MESSAGES[number]], first_seq=number + 1, stamp_ns=number * STEP_NS)
        replica.publish(run)


async def test_a_viewer_remote_asks_the_home_for_a_key_frame() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        asked = list[tuple[str, str]]()
        a.live.on_key_wanted(lambda robot, topic: asked.append((robot, topic)))
        a.link("r1", 1)
        a.announce("r1", [video()])
        await known(b, "r1", 1)
        _viewer, seen = b.look("/video")
        await wanted(a, "r1", {"/video": 0.0})
        publish(a, video(), 1, 2, 6, 7)
        await wait_until_async(lambda: seen.payloads == MESSAGES[6:8])
        await wait_until_async(lambda: asked == [("r1", "/video")])
        _other, _ = b.look("/video")
        await wait_until_async(lambda: len(asked) == 2)


async def test_what_was_lost_between_gateways_stops_the_viewers_up_to_a_key_frame() -> None:
    async with replicas(FakeMeshes(), "a", "b") as (a, b):
        a.link("r1", 1)
        a.announce("r1", [video()])
        await known(b, "r1", 1)
        _viewer, seen = b.look("/video")
        _here, seen_here = a.look("/video")
        await wanted(a, "r1", {"/video": 0.0})
        publish(a, video(), 0, 1)
        await wait_until_async(lambda: len(seen.payloads) == 2)
        send, a.mesh.send = a.mesh.send, lambda *_: True  # type: ignore[method-assign]
        publish(a, video(), 2)
        await wait_until_async(lambda: a.live.waiting_bytes == 0)
        a.mesh.send = send  # type: ignore[method-assign]
        publish(a, video(), 3, 4, 5, 6, 7)
        await wait_until_async(lambda: seen.payloads == [*MESSAGES[:2], *MESSAGES[6:8]])
        await wait_until_async(lambda: seen_here.payloads == MESSAGES[:8])


async def test_a_rate_crosses_as_the_whole_stream_or_as_key_frames() -> None:
    async with replicas(FakeMeshes(), "a", "b", "c") as (a, b, c):
        a.link("r1", 1)
        a.announce("r1", [video()])
        await known(b, "r1", 1)
        await known(c, "r1", 1)
        _b, slow = b.look("/video", rate_hz=1.0)
        await wanted(a, "r1", {"/video": 1.0})  # else b's wish may come after the first samples
        _c, whole = c.look("/video", rate_hz=5.0)
        await wanted(a, "r1", {"/video": 5.0})
        publish(a, video(), *range(24))
        await wait_until_async(lambda: whole.payloads == MESSAGES)
        await wait_until_async(lambda: slow.payloads == [MESSAGES[0], MESSAGES[12]])
        assert b.live.received_samples == 2
