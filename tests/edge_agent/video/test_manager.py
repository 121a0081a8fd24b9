"""Sources hear of viewers, key frames and bit rates, no more often than they may, and only those of this robot."""

from __future__ import annotations

import asyncio

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.scope import Scope
from edge_agent.forwarding.video_queue import VideoQueue
from edge_agent.link.budget import Budget
from edge_agent.link.frames import ControlFrame
from edge_agent.video.manager import VideoManager
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import ManualClock
from metaros.errors import NameError_
from metaros.idl import type_hash
from tests.edge_agent.parts import make_outbox
from tests.edge_agent.session_rig import SessionRig
from tests.support.waiting import wait_until_async

DEMAND = "metaros_msgs/msg/VideoDemand"
TYPES = {
    1: ("/r1/front/video", "foxglove_msgs/msg/CompressedVideo"),
    2: ("/r1/rear/video", "metaros_msgs/msg/VideoPacket"),
    3: ("/r1/text", "std_msgs/msg/String"),
    4: ("/r2/video", "foxglove_msgs/msg/CompressedVideo"),
}


class Rig:
    """A desk over four channels, of which two are video of this robot."""

    def __init__(self, *, bytes_per_s: int = 0, refuse: bool = False) -> None:
        self.clock = ManualClock()
        self.channels = Channels(TopicTable([TopicRule(match="**")]), make_outbox().ids, namespace="/r1")
        for topic, type_name in TYPES.values():
            self.channels.observe(topic, type_name, type_hash(type_name), qos="", keeps_all=False)
        budget = Budget(limit_bytes_per_s=bytes_per_s, now_s=0.0)
        self.said: list[tuple[str, bool, int, int]] = []
        self._refuse = refuse
        self.manager = VideoManager(self.channels, Scope("/r1"), budget, self._publish, self.clock)

    def _publish(self, topic: str, type_name: str, hash_text: str, payload: bytes) -> None:
        if self._refuse:
            raise NameError_("too long")
        assert (type_name, hash_text) == (DEMAND, type_hash(DEMAND))
        demand = codec(DEMAND).decode(payload)
        self.said.append((topic, demand.key_frame, demand.viewers, demand.bitrate_bps))

    def line(self, number: int = 1) -> VideoQueue:
        channel = self.channels.by_id(number)
        assert channel is not None
        assert channel.video is not None
        return channel.video

    def demand(self, *entries: tuple[int, int, int]) -> None:
        """The gateway wants these channels, with so many viewers, and that number of key frames."""
        reported = link_pb2.Demand(
            entries=[link_pb2.DemandEntry(channel_id=n, viewers=v, key_frames=k) for n, v, k in entries]
        )
        self.manager.take(ControlFrame(link_pb2.GatewayFrame(demand=reported), 0.0))

    def look(self, after_s: float = 0.25) -> list[tuple[str, bool, int, int]]:
        """What is said when so much time has passed, since the last time."""
        self.clock.advance(after_s)
        self.manager.look()
        said, self.said = self.said, []
        return said


FRONT, REAR = "/r1/front/video/demand", "/r1/rear/video/demand"


def test_only_video_of_this_robot_is_reported() -> None:
    rig = Rig()
    rig.demand((1, 2, 0), (2, 1, 0), (3, 1, 0), (4, 1, 0), (99, 1, 0))
    assert rig.said == [(FRONT, True, 2, 0), (REAR, True, 1, 0)]
    rig.said.clear()
    rig.demand((2, 1, 0))
    assert rig.said == [(FRONT, False, 0, 0)]
    rig.manager.link_down()
    assert rig.said[1:] == [(REAR, False, 0, 0)]
    rig.manager.link_down()
    assert len(rig.said) == 2


def test_an_older_gateway_says_nothing_of_viewers() -> None:
    rig = Rig()
    rig.demand((1, 0, 0))
    assert rig.said == [(FRONT, True, 1, 0)]


def test_key_frames_are_asked_for_four_times_a_second_at_most() -> None:
    rig = Rig()
    rig.demand((1, 1, 0))
    rig.said.clear()
    for number in range(1, 6):
        rig.demand((1, 1, number))
    assert rig.said == []
    assert rig.look() == [(FRONT, True, 1, 0)], "the one that was put off"
    assert rig.look() == []
    rig.line().key_wanted = True
    assert rig.look(0.1) == [(FRONT, True, 1, 0)]
    asked = 0
    for _ in range(100):
        rig.line().key_wanted = True
        asked += len(rig.look(0.01))
    assert asked <= 4


def test_viewers_and_the_same_again() -> None:
    rig = Rig()
    rig.demand((1, 1, 0))
    rig.demand((1, 3, 0))
    assert rig.said == [(FRONT, True, 1, 0), (FRONT, False, 3, 0)]
    rig.said.clear()
    said = [rig.look(0.25) for _ in range(16)]
    assert [index for index, some in enumerate(said) if some] == [7, 15], "every two seconds"


def test_the_bit_rate_follows_budget_and_backlog() -> None:
    rig = Rig(bytes_per_s=500_000)  # 4 Mbit/s, of which 70 % is for both
    rig.demand((1, 1, 0), (2, 1, 0))
    rig.look(0.5)
    assert rig.look(0.5) == [(FRONT, False, 1, 1_000_000), (REAR, False, 1, 1_000_000)]
    rig.demand((1, 1, 0))
    rig.said.clear()
    assert rig.look(1.0) == [(FRONT, False, 1, 2_500_000)]
    line = rig.line()
    line.pushed(0)
    line.pushed(500_000_000)
    line.sent_bytes += 150_000  # 1.2 Mbit in a second
    assert rig.look(1.0) == [(FRONT, False, 1, 650_000)]
    line.popped(10)
    line.popped(10)
    said = [rig.look(1.0) for _ in range(5)]
    assert [some[0][3] for some in said if some][-1] == 1_000_000


def test_a_source_that_cannot_be_reported_ends_nothing() -> None:
    rig = Rig(refuse=True)
    rig.demand((1, 1, 0))
    rig.manager.link_down()
    assert rig.said == []


async def test_it_looks_by_itself_while_somebody_watches_and_says_when_it_ends() -> None:
    rig = Rig()
    running = asyncio.create_task(rig.manager.run())
    rig.demand((1, 1, 0))
    rig.clock.advance(1.0)
    rig.line().key_wanted = True
    await wait_until_async(lambda: len(rig.said) >= 2)
    assert rig.said[:2] == [(FRONT, True, 1, 0), (FRONT, True, 1, 0)]
    running.cancel()
    await asyncio.wait({running})
    assert rig.said[-1] == (FRONT, False, 0, 0)


def test_the_session_hands_the_manager_what_is_wanted() -> None:
    rig = SessionRig()
    rig.connect()
    frame = link_pb2.GatewayFrame(demand=link_pb2.Demand(entries=[link_pb2.DemandEntry(channel_id=4, key_frames=7)]))
    (reported,) = rig.session.receive(link_pb2.LANE_CONTROL, frame)
    assert isinstance(reported, ControlFrame)
    assert reported.frame == frame
