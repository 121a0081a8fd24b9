"""Video to viewers: what each gets can be decoded, whoever is slow, and key frames are asked for where they help."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.api.ws.records import BinaryRecords, JsonMessages
from gateway.domain.channel import Channel
from gateway.live.scope import matching
from gateway.live.subscription import TopicSubscription
from metaros.idl.globs import Glob
from tests.support.devices.video import COMPRESSED_VIDEO, access_units, pictures, video_message
from tests.support.gateways.hub_rig import ListSink, Rig, make_run

KEYS = {0, 6, 12, 18}
STEP_NS = 33_000_000


@cache
def messages() -> list[bytes]:
    """Of 24 pictures, in groups of six."""
    return [video_message(unit) for unit in access_units(24, group=6)]


@cache
def seen_in(numbers: tuple[int, ...]) -> list[bytes]:
    """The pictures that a decoder makes of some of them."""
    return pictures(messages()[number] for number in numbers)


def video(*, encoding: str = "cdr") -> Channel:
    return Channel(
        robot="r", channel_id=1, topic="/r/video", schema_name=COMPRESSED_VIDEO, type_hash="h", encoding=encoding
    )


def subscription(number: int = 1, *, json: bool = False, **options: Any) -> TopicSubscription:
    form = JsonMessages(number, 7) if json else BinaryRecords(number, 7)
    return TopicSubscription(number, matching(Glob("*"), Glob("**")), lambda channel: form, **options)


class VideoRig(Rig):
    """A hub with one viewer of one video topic, and what it asks the robot for."""

    def __init__(self, *subscriptions: TopicSubscription, channel: Channel | None = None) -> None:
        super().__init__()
        self.asked: list[tuple[str, str]] = []
        self.hub.on_key_wanted = lambda robot, topic: self.asked.append((robot, topic))
        self.channel = channel or video()
        for item in subscriptions:
            self.viewer.subscribe(item)

    def come(self, *numbers: int, after_s: float = 0.033) -> None:
        """These of the messages come, one after the other, numbered from 1."""
        for number in numbers:
            self.hub.publish(make_run(number + 1, [messages()[number]], self.channel, step_ns=STEP_NS))
            self.pass_time(after_s)

    def frames(self, sink: ListSink | None = None) -> list[int]:
        """Which of them a viewer got since."""
        return [seq - 1 for _, seq, _ in self.got(sink)]


def check(numbers: Sequence[int]) -> None:
    """Whoever got these sees what was recorded."""
    assert all(number in KEYS or number - 1 in numbers for number in numbers)
    assert seen_in(tuple(numbers)) == [seen_in(tuple(range(24)))[number] for number in numbers]


def test_who_joins_gets_nothing_before_a_key_frame_which_is_asked_for_at_once() -> None:
    rig, late = VideoRig(subscription()), ListSink()
    rig.come(0, 1, 2)
    rig.asked.clear()
    rig.join(late).subscribe(subscription(2))
    assert rig.asked == [("r", "/r/video")]
    rig.come(3, 4, 5, 6, 7)
    assert rig.frames() == list(range(8))
    assert rig.frames(late) == [6, 7]
    assert len(rig.asked) == 1
    assert rig.notices == [], "what was before it is no loss"


@pytest.mark.parametrize("latest", [True, False])
def test_mode_and_rate_never_thin_single_frames(latest: bool) -> None:
    rig = VideoRig(subscription(latest=latest, max_rate_hz=5.0))
    rig.hub.publish(make_run(1, messages()[:10], rig.channel, step_ns=STEP_NS))
    rig.pass_time(0.05)
    rig.come(*range(10, 24), after_s=0.0)
    rig.pass_time(0.05)
    assert rig.frames() == list(range(24))


@pytest.mark.parametrize("latest", [True, False])
def test_two_hertz_and_less_are_key_frames_only(latest: bool) -> None:
    rig, whole = VideoRig(subscription(latest=latest, max_rate_hz=2.0)), ListSink()
    rig.join(whole).subscribe(subscription())
    rig.come(*range(24))
    assert rig.frames() == [0, 18]
    assert rig.frames(whole) == list(range(24))


def test_a_hole_on_the_way_stops_everybody_up_to_the_next_key_frame() -> None:
    rig = VideoRig(subscription())
    rig.come(0, 1)
    rig.asked.clear()
    rig.come(3, 4, 5)
    assert rig.asked == [], "it asked when it joined"
    rig.pass_time(2.0)
    rig.come(8)
    assert rig.asked == [("r", "/r/video")]
    rig.come(9, 12, 13)
    assert rig.frames() == [0, 1, 12, 13]
    rig.pass_time(1.0)
    assert rig.notices[-1][2] == 5


def test_a_run_with_key_frames_inside_is_cut_at_them() -> None:
    rig = VideoRig(subscription())
    rig.hub.publish(make_run(3, messages()[2:20], rig.channel))
    rig.pass_time()
    assert rig.frames() == list(range(6, 20))


def test_a_slow_viewer_of_mode_latest_gets_the_newest_group_and_the_fast_one_everything() -> None:
    rig, fast = VideoRig(subscription(latest=True)), ListSink()
    rig.join(fast).subscribe(subscription(2))
    rig.come(0, 1)
    rig.sink.shut()
    rig.come(*range(2, 15))
    rig.sink.reopen()
    rig.come(15)
    slow = rig.frames()
    assert slow == [0, 1, 12, 13, 14, 15]
    check(slow)
    assert rig.frames(fast) == list(range(16))
    assert rig.notices == [], "in this mode what is replaced was not lost"


def test_a_short_wait_loses_nothing() -> None:
    rig = VideoRig(subscription(latest=True))
    rig.come(0, 1)
    rig.sink.shut()
    rig.come(2, 3, 4)
    rig.sink.reopen()
    rig.come(5)
    assert rig.frames() == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize("latest", [True, False])
def test_a_full_queue_drops_groups_says_so_and_asks_when_there_is_room(latest: bool) -> None:
    rig = VideoRig(subscription(latest=latest, queue_bytes=sum(map(len, messages()[1:4]))))
    rig.come(0)
    rig.pass_time(3.0)
    rig.asked.clear()
    rig.sink.shut()
    rig.come(*range(1, 6))
    assert rig.viewer.size_bytes <= sum(map(len, messages()[1:4]))
    assert rig.asked == [], "who takes nothing needs no key frame"
    rig.sink.reopen()
    rig.come(8)
    assert rig.asked == [("r", "/r/video")]
    rig.come(12, 13)
    got = rig.frames()
    assert got == [0, 12, 13]
    rig.pass_time(1.0)
    assert rig.notices[-1][2] == 6


def test_a_queue_keeps_whole_groups_in_order() -> None:
    rig = VideoRig(subscription(queue_bytes=1 << 20))
    rig.sink.shut()
    rig.come(*range(20))
    rig.sink.reopen()
    assert rig.frames() == list(range(20))


def test_other_topics_that_wait_keep_their_places() -> None:
    rig = VideoRig(subscription(queue_bytes=3000))
    rig.come(0)
    rig.sink.shut()
    for number in range(1, 24):
        rig.come(number)
        rig.hub.publish(make_run(number, [b"%d" % number]))
        rig.pass_time(0.005)
    rig.sink.reopen()
    got = rig.got()
    texts = [int(payload) for _, _, payload in got if len(payload) < 5]
    assert texts == list(range(texts[0], 24))
    check([seq - 1 for _, seq, payload in got if len(payload) >= 5])


def test_newest_samples_of_other_topics_do_not_starve_video() -> None:
    rig = VideoRig(subscription(latest=True))
    rig.come(0)
    rig.got()
    rig.sink.shut()
    rig.come(1, 2)
    for number in range(4):
        rig.hub.publish(make_run(1, [b"x"], Channel(**{**CHANNEL, "topic": f"/{number}"})))
    rig.pass_time(0.01)
    rig.sink.reopen(takes=4)
    assert [seq - 1 for _, seq, payload in rig.got() if len(payload) > 5] == [1, 2]


CHANNEL: dict[str, Any] = {"robot": "r", "channel_id": 1, "schema_name": "a/msg/B", "type_hash": "h"}


def test_sealed_video_passes_as_it_comes_and_key_frames_are_asked_for() -> None:
    rig = VideoRig(subscription(latest=True), channel=video(encoding="sealed/cdr"))
    rig.come(1, 2, 3)
    assert rig.frames() == [1, 2, 3]
    assert len(rig.asked) == 1
    rig.pass_time(3.0)
    rig.come(5)
    assert (rig.frames(), len(rig.asked)) == ([5], 2)


def test_json_is_gated_as_well() -> None:
    rig = VideoRig(subscription(json=True))
    rig.hub.publish(make_run(2, messages()[1:8], rig.channel))
    rig.pass_time()
    assert b"".join(rig.sink.frames).count(b'"seq":') == 2


def test_lookers_are_counted() -> None:
    rig = VideoRig(subscription(1), subscription(2, latest=True))
    rig.come(0)
    assert rig.hub.viewer_count(rig.channel) == 2
    rig.viewer.unsubscribe(2)
    assert rig.hub.viewer_count(rig.channel) == 1
    rig.viewer.close()
    assert rig.hub.viewer_count(rig.channel) == 0


@settings(max_examples=30)
@given(st.data(), st.booleans(), st.integers(600, 5000), st.booleans())
def test_every_viewer_can_decode_what_it_gets(data: st.DataObject, latest: bool, room: int, lossy: bool) -> None:
    rig, fast = VideoRig(subscription(latest=latest, queue_bytes=room)), ListSink()
    rig.join(fast).subscribe(subscription(2))
    slow: list[int] = []
    for number in range(24):
        if not (lossy and data.draw(st.integers(0, 5)) == 0):
            rig.come(number)
        if data.draw(st.booleans()):
            if rig.sink.open:
                rig.sink.shut()
            else:
                rig.sink.reopen(takes=data.draw(st.integers(1, 3)))
        assert rig.viewer.size_bytes <= room + max(map(len, messages())) + 64
        slow += rig.frames()
    if not rig.sink.open:
        rig.sink.reopen()
    slow += rig.frames()
    seen = rig.frames(fast)
    check(slow)
    check(seen)
    if not lossy:
        assert seen == list(range(24))
