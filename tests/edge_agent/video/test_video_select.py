"""Video leaves the robot whole or by its key frames, whatever limits and losses there are."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.forwarding.channel import Channel
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.live_batch import Linger
from edge_agent.forwarding.live_queue import OVERHEAD_BYTES, LiveQueue
from edge_agent.forwarding.pipeline import Arrival, Pipeline
from metaros._proto import link_pb2
from metaros.idl import type_hash
from metaros.link import unpack_batch
from tests.edge_agent.parts import make_outbox, taken
from tests.support.devices.video import COMPRESSED_VIDEO, access_units, pictures, video_message

UNITS = access_units(24, group=6)
MESSAGES = [video_message(unit) for unit in UNITS]
PICTURES = pictures(MESSAGES)
SIZES = [len(message) + OVERHEAD_BYTES for message in MESSAGES]
STEP_NS = 33_000_000


class Rig:
    """A video topic of an agent, with a row of the topic table of its own."""

    def __init__(self, rule: TopicRule | None = None, *, live_bytes: int = 1 << 20) -> None:
        self.outbox, self.live = make_outbox(), LiveQueue(max_bytes=live_bytes)
        self.outbox.online = True
        self.channels = Channels(TopicTable([rule or TopicRule(match="**")]), self.outbox.ids, namespace="/")
        self.pipeline = Pipeline(self.outbox, self.live, Linger(), wake_writer=lambda: None, wake_uplink=lambda: None)
        found = self.channels.observe("/video", COMPRESSED_VIDEO, type_hash(COMPRESSED_VIDEO), qos="", keeps_all=False)
        assert found is not None
        self.channel: Channel = found

    def arrive(self, *numbers: int, publisher: bytes = b"p") -> None:
        """These of the messages come from a publisher that numbers them so."""
        for number in numbers:
            payload, stamp_ns = MESSAGES[number], number * STEP_NS
            arrived = Arrival(self.channel, payload, len(payload), stamp_ns, stamp_ns / 1e9, publisher, number)
            self.pipeline.take([arrived], stamp_ns / 1e9)

    def sent(self) -> list[int]:
        """Which of them go out of the live queue."""
        runs = self.live.take(1 << 30)
        return [MESSAGES.index(sample.data) for run in runs.values() for sample in run]

    def kept(self) -> list[int]:
        """Which of them the outbox sends."""
        found = []
        for item in taken(self.outbox, "bulk"):
            batch = link_pb2.Batch.FromString(item.frame.body)
            batch.count, batch.first_seq, batch.stream_id = item.frame.count, item.frame.first_seq, 1
            found += [MESSAGES.index(bytes(payload)) for _, _, payload in unpack_batch(batch).samples()]
        return found


def test_a_viewer_begins_at_a_key_frame_and_asks_for_one() -> None:
    rig = Rig()
    rig.arrive(0, 1, 2)
    rig.channels.demand({1: 0.0})
    rig.arrive(3, 4)
    assert rig.channel.video is not None
    assert rig.channel.video.key_wanted
    rig.arrive(5, 6, 7, 8)
    assert rig.sent() == [6, 7, 8]
    rig.channels.demand({})
    rig.arrive(9)
    rig.channels.demand({1: 0.0})
    rig.arrive(10, 11, 12)
    assert rig.sent() == [12], "what was not taken is a hole"


def test_limits_above_two_hertz_never_thin_and_below_them_only_key_frames_go() -> None:
    rig = Rig(TopicRule(match="**", max_rate_hz=10.0))
    rig.channels.demand({1: 5.0})
    rig.arrive(*range(24))
    assert rig.sent() == list(range(24))
    rig.channels.demand({1: 2.0})
    rig.arrive(*range(24))
    assert rig.sent() == [0, 12], "key frames come five times a second"


def test_a_lost_frame_or_another_publisher_waits_for_a_key_frame() -> None:
    rig = Rig()
    rig.channels.demand({1: 0.0})
    rig.arrive(0, 1, 3, 4, 6, 7)
    rig.arrive(8, 9, publisher=b"q")
    rig.arrive(10, 12, 13)
    assert rig.sent() == [0, 1, 6, 7, 12, 13]


def test_history_takes_key_frames_and_bulk_takes_all() -> None:
    rig = Rig(TopicRule(match="**", history_hz=1.0))
    rig.arrive(*range(24))
    assert rig.kept() == [0, 18]
    rig = Rig(TopicRule(match="**", delivery="bulk"))
    rig.arrive(*range(3), *range(4, 8))
    assert rig.kept() == [0, 1, 2, 4, 5, 6, 7], "it is kept as it was published"


async def test_latest_only_replaces_whole_groups() -> None:
    rig = Rig(TopicRule(match="**", delivery="bulk", latest_only=True))
    rig.arrive(0, 1)
    rig.outbox.online = False
    rig.arrive(*range(2, 15))
    rig.outbox.online = True
    rig.arrive(15, 18, 19)
    assert rig.kept() == [0, 1, 18, 19], "what followed those that were replaced was not taken"
    assert rig.channel.thinned == 14


def test_a_full_queue_drops_up_to_the_newest_key_frame() -> None:
    rig = Rig(live_bytes=sum(SIZES[:9]))
    rig.channels.demand({1: 0.0})
    rig.arrive(*range(10))
    sent = rig.sent()
    assert sent == [6, 7, 8, 9]
    assert rig.channel.dropped == 6
    assert rig.channel.video is not None
    assert rig.channel.video.is_behind()
    assert not rig.channel.video.is_behind(), "asked again, it keeps up"
    assert not rig.channel.video.key_wanted


def test_a_group_that_does_not_fit_goes_whole_and_a_key_frame_is_wanted() -> None:
    rig = Rig(live_bytes=sum(SIZES[:4]))
    rig.channels.demand({1: 0.0})
    rig.arrive(*range(6))
    assert rig.channel.video is not None
    assert (len(rig.live), rig.live.size_bytes, rig.channel.dropped) == (0, 0, 6)
    assert rig.channel.video.key_wanted
    rig.arrive(6, 7)
    assert rig.sent() == [6, 7]


def test_video_that_waits_for_longer_than_a_second_yields_to_newer() -> None:
    rig = Rig()
    rig.channels.demand({1: 0.0})
    stamps = [0, 200, 400, 600, 800, 950]
    for number, stamp_ms in enumerate(stamps):
        rig.live.append(rig.channel, stamp_ms * 1_000_000, MESSAGES[number])
    assert rig.channel.video is not None
    assert rig.channel.video.waiting_s == 0.95
    rig.live.append(rig.channel, 1_100_000_000, MESSAGES[6])
    assert rig.sent() == [6]
    rig.live.append(rig.channel, 1_200_000_000, MESSAGES[7])
    rig.live.append(rig.channel, 2_300_000_000, MESSAGES[8])
    assert (rig.sent(), rig.channel.video.closed, rig.channel.video.key_wanted) == ([], True, True)
    rig.live.append(rig.channel, 2_400_000_000, MESSAGES[9])
    rig.live.append(rig.channel, 2_500_000_000, MESSAGES[12])
    assert rig.sent() == [12]


def test_other_topics_keep_their_places_when_video_is_cut() -> None:
    rig = Rig(live_bytes=sum(SIZES[:6]) + 2 * (OVERHEAD_BYTES + 1))
    other = rig.channels.observe("/text", "std_msgs/msg/String", "RIHS01_x", qos="", keeps_all=False)
    assert other is not None
    rig.channels.demand({1: 0.0})
    rig.arrive(0)
    rig.live.append(other, 1, b"a")
    rig.arrive(1)
    rig.live.append(other, 2, b"b")
    rig.arrive(2, 3, 4, 5, 6)
    runs = rig.live.take(1 << 30)
    assert [sample.data for sample in runs[other.channel_id]] == [b"a", b"b"]
    assert [MESSAGES.index(sample.data) for sample in runs[1]] == [6]
    assert (rig.live.size_bytes, len(rig.live)) == (0, 0)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.one_of(st.tuples(st.just("take"), st.integers(1, 6)), st.tuples(st.just("lose"), st.integers(0, 0))),
        max_size=60,
    ),
    st.integers(2, 8),
)
def test_what_goes_out_can_be_decoded_however_slow_the_link_is(moves: list[tuple[str, int]], room: int) -> None:
    rig, sent = Rig(live_bytes=room * max(SIZES) // 2), list[int]()
    rig.channels.demand({1: 0.0})
    turns = iter(moves)
    for number in range(24):
        move, count = next(turns, ("", 0))
        if move != "lose":
            rig.arrive(number)
        assert rig.live.size_bytes <= rig.live.max_bytes
        if move == "take":
            for run in rig.live.take(count * SIZES[1]).values():
                sent += [MESSAGES.index(sample.data) for sample in run]
    sent += rig.sent()
    assert all(number % 6 == 0 or number - 1 in sent for number in sent)
    assert pictures(MESSAGES[number] for number in sent) == [PICTURES[number] for number in sent]
    assert rig.live.size_bytes == 0


def test_frames_are_reported_apart_before_they_are_sealed() -> None:
    rig = Rig(live_bytes=sum(SIZES[:9]))
    rig.live.seal = lambda channel, seq, payload: payload[::-1]
    rig.channels.demand({1: 0.0})
    rig.arrive(*range(10))
    (run,) = rig.live.take(1 << 30).values()
    assert [MESSAGES.index(sample.data[::-1]) for sample in run] == [6, 7, 8, 9]


def test_a_link_that_ends_forgets_what_waits() -> None:
    rig = Rig()
    rig.channels.demand({1: 0.0})
    rig.arrive(0, 1)
    rig.channels.demand({})
    rig.live.clear()
    assert rig.channel.video is not None
    assert (rig.channel.video.waiting_s, rig.channel.dropped, len(rig.live)) == (0.0, 2, 0)
    rig.channels.demand({1: 0.0})
    rig.arrive(2, 6)
    assert rig.sent() == [6]
