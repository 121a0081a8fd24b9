"""What robots are told of their video: how many look, and key frames, neither too often nor never."""

from __future__ import annotations

import asyncio
import itertools
from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.domain.channel import Channel
from gateway.live.demand_manager import DemandManager
from gateway.live.hub import Hub
from gateway.live.video_demand import VideoDemand
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from tests.support.devices.video import COMPRESSED_VIDEO
from tests.support.gateways.hub_rig import ListSink, make_channel, make_subscription
from tests.support.waiting import wait_until_async


def test_viewers_and_key_frames_are_reported_once() -> None:
    registry = VideoDemand()
    assert registry.due("r", {}, now_s=0) is None
    assert registry.due("r", {"/v": 1}, now_s=0) == {"/v": (1, 0)}
    assert registry.due("r", {"/v": 1}, now_s=1) is None
    registry.want_key("r", "/v")
    assert registry.due("r", {"/v": 1}, now_s=1) == {"/v": (1, 1)}
    assert registry.due("r", {"/v": 2}, now_s=1) == {"/v": (2, 1)}
    assert (registry.sent("r"), registry.waiting()) == ({"/v": (2, 1)}, set())
    assert registry.due("r", {}, now_s=2) == {}


def test_a_key_frame_too_soon_after_another_comes_a_little_later() -> None:
    registry = VideoDemand()
    registry.want_key("r", "/v")
    assert registry.due("r", {"/v": 1}, now_s=10) == {"/v": (1, 1)}
    registry.want_key("r", "/v")
    registry.want_key("r", "/v")
    assert registry.due("r", {"/v": 1}, now_s=10.1) is None
    assert registry.waiting() == {"r"}
    assert registry.due("r", {"/v": 1}, now_s=10.25) == {"/v": (1, 2)}
    assert registry.waiting() == set()


def test_nobody_looks_any_more_or_the_link_is_new() -> None:
    registry = VideoDemand()
    registry.want_key("r", "/v")
    assert registry.due("r", {"/w": 1}, now_s=0) == {"/w": (1, 0)}
    assert registry.waiting() == set()
    registry.want_key("r", "/w")
    registry.forget("r")
    assert registry.waiting() == set()
    assert registry.due("r", {"/w": 1}, now_s=0) == {"/w": (1, 0)}


@settings(max_examples=50)
@given(st.lists(st.tuples(st.booleans(), st.floats(0, 0.3)), max_size=60))
def test_never_more_than_four_a_second_and_the_last_wish_is_received(steps: list[tuple[bool, float]]) -> None:
    registry, now_s, asked = VideoDemand(), 0.0, list[float]()
    number = 0
    for wish, passed_s in steps:
        now_s += passed_s
        if wish:
            registry.want_key("r", "/v")
        state = registry.due("r", {"/v": 1}, now_s=now_s)
        if state is not None and state["/v"][1] != number:
            number = state["/v"][1]
            asked.append(now_s)
    assert all(later - sooner >= 0.25 for sooner, later in itertools.pairwise(asked))
    left = bool(registry.waiting())
    state = registry.due("r", {"/v": 1}, now_s=now_s + 1)
    assert (state is not None and state["/v"][1] == number + 1) == left or not steps


class Rig:
    """A desk, the hub whose viewers it speaks for, and what robot r was told."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.hub = Hub(clock=self.clock)
        self.channels: list[Channel] = [
            replace(make_channel("/r/video"), schema_name=COMPRESSED_VIDEO),
            replace(make_channel("/r/scan"), channel_id=2),
            replace(make_channel("/r/kept"), channel_id=3, schema_name=COMPRESSED_VIDEO, delivery="bulk"),
        ]
        self.sent: list[link_pb2.Demand] = []
        self.manager = DemandManager(
            self.hub,
            online=lambda: ["r"],
            channels_of=lambda robot: self.channels if robot == "r" else None,
            send=lambda robot, frame: self.sent.append(frame.demand),
            clock=self.clock,
        )

    def entry(self) -> tuple[int, int] | None:
        """Viewers and key frames of the video topic, as they were told last."""
        found = [entry for entry in self.sent[-1].entries if entry.channel_id == 1] if self.sent else []
        return (found[0].viewers, found[0].key_frames) if found else None


async def test_the_manager_tells_of_viewers_and_key_frames() -> None:
    rig = Rig()
    running = asyncio.create_task(rig.manager.run())
    viewer = rig.hub.join(ListSink())
    viewer.subscribe(make_subscription(1))
    await wait_until_async(lambda: rig.entry() == (1, 1))
    assert {entry.channel_id: (entry.viewers, entry.key_frames) for entry in rig.sent[-1].entries}[2] == (0, 0)
    rig.clock.advance(1.0)
    viewer.subscribe(make_subscription(2))
    await wait_until_async(lambda: rig.entry() == (2, 2))
    rig.manager.others = lambda robot: {"/r/video": 0.0}
    rig.clock.advance(1.0)
    rig.manager.key_wanted("r", "/r/video")
    await wait_until_async(lambda: rig.entry() == (3, 3))
    count = len(rig.sent)
    rig.manager.key_wanted("r", "/r/scan")
    rig.manager.key_wanted("r", "/r/nothing")
    rig.manager.key_wanted("elsewhere", "/r/video")
    rig.manager.others = lambda robot: {}
    viewer.close()
    rig.clock.advance(1.0)
    await wait_until_async(lambda: len(rig.sent) > count)
    assert rig.entry() == (0, 3), "it is let go a little later, for a page that reloads"
    rig.manager.link_changed("r")
    await wait_until_async(lambda: rig.manager.sent("r") == {})
    running.cancel()
    await asyncio.wait({running})
