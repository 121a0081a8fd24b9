"""Fan-out: who gets what, how fast, and how much may wait."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.domain.records import HEADER, Record, record_parts, split_records
from gateway.errors import InvalidRequestError, TooManyError
from gateway.live.feeds import Feeds, FleetSubscription, MetricSubscription
from gateway.live.viewer import Viewer
from metaros.errors import FrameError
from metaros.idl.globs import Glob
from metaros.limits import Limits
from tests.support.gateways.hub_rig import ListSink, Rig, make_channel, make_run, make_subscription


def test_queue_keeps_order_and_bytes() -> None:
    rig = Rig(make_subscription())
    rig.hub.publish(make_run(1, [b"a", b"bb", b"c" * 9]))
    rig.pass_time()
    assert rig.got() == [(1, 1, b"a"), (1, 2, b"bb"), (1, 3, b"c" * 9)]
    rig.hub.publish(make_run(4, [b"d"]))
    assert rig.got() == [], "what comes within a tick of a write shares the next one"
    rig.hub.publish(make_run(5, [b"e"]))
    rig.pass_time(0.005)
    assert len(rig.sink.frames) == 1
    assert rig.got() == [(1, 4, b"d"), (1, 5, b"e")]


def test_viewers_with_equal_encodings_get_the_same_bytes_object() -> None:
    rig, others = Rig(make_subscription()), [ListSink() for _ in range(3)]
    for sink, number in zip(others, (1, 1, 2), strict=True):
        rig.join(sink).subscribe(make_subscription(number))
    rig.hub.publish(make_run(1, [b"x"] * 5))
    rig.pass_time()
    assert all(sink.frames[0] is rig.sink.frames[0] for sink in others[:2])
    assert rig.got(others[2]) == [(2, seq, b"x") for seq in range(1, 6)], "another number makes other bytes"


def test_latest_sends_the_newest_of_each_channel_in_a_tick() -> None:
    rig = Rig(make_subscription(latest=True))
    rig.hub.publish(make_run(1, [b"first"]))
    rig.pass_time()
    rig.got()
    for first in (2, 5):
        rig.hub.publish(make_run(first, [b"x", b"y", b"z"]))
        rig.hub.publish(make_run(first, [b"1", b"2"], make_channel("/r/odom")))
    rig.pass_time(0.005)
    assert sorted(rig.got()) == [(1, 6, b"2"), (1, 7, b"z")]


def test_globs_choose_also_for_channels_that_come_later() -> None:
    rig = Rig(make_subscription(1, "/r/scan"))
    rig.hub.publish(make_run(1, [b"a"]))
    rig.viewer.subscribe(make_subscription(2, "/r/*"))
    rig.hub.publish(make_run(2, [b"a"]))
    rig.hub.publish(make_run(1, [b"b"], make_channel("/r/odom")))
    rig.hub.publish(make_run(1, [b"c"], make_channel("/q/odom/deep")))
    rig.pass_time(0.005)
    assert sorted(rig.got()) == [(1, 1, b"a"), (1, 2, b"a"), (2, 1, b"a"), (2, 1, b"b"), (2, 2, b"a")]


def test_rate_limit_sends_the_newest_when_it_is_due() -> None:
    rig, sent = Rig(make_subscription(latest=True, max_rate_hz=10)), []
    for step in range(100):  # 100 Hz for one second
        rig.hub.publish(make_run(step + 1, [b"x"]))
        rig.pass_time(0.01)
        sent += [seq for _, seq, _ in rig.got()]
    assert 10 <= len(sent) <= 11
    rig.pass_time(0.2)
    assert [*sent, *(seq for _, seq, _ in rig.got())][-1] == 100, "the last of a burst always arrives"


def test_two_rates_of_one_topic_each_get_theirs() -> None:
    rig, slow = Rig(make_subscription(latest=True, max_rate_hz=30)), ListSink()
    rig.join(slow).subscribe(make_subscription(latest=True, max_rate_hz=1))
    for step in range(300):  # 30 Hz for ten seconds
        rig.hub.publish(make_run(step + 1, [b"x"]))
        rig.pass_time(1 / 30)
    assert len(rig.got()) >= 290
    assert 10 <= len(rig.got(slow)) <= 11


def test_a_queue_is_thinned_by_stamps() -> None:
    rig = Rig(make_subscription(max_rate_hz=10))
    rig.hub.publish(make_run(1, [b"x"] * 50, step_ns=10_000_000))  # 100 Hz in one burst
    rig.pass_time()
    assert [seq for _, seq, _ in rig.got()] == [1, 11, 21, 31, 41]


def test_a_full_queue_drops_the_oldest_and_says_so() -> None:
    rig = Rig(make_subscription(queue_bytes=10 * 48))
    rig.sink.shut()
    rig.hub.publish(make_run(1, [b"x"] * 25))
    rig.pass_time()
    rig.sink.reopen()
    assert [seq for _, seq, _ in rig.got()] == list(range(16, 26))
    assert (rig.notices, rig.viewer.size_bytes, rig.viewer.clear) == ([(1, 15, 15)], 0, True)
    rig.sink.shut()
    rig.hub.publish(make_run(26, [b"x"] * 11))
    rig.pass_time(0.1)
    rig.sink.reopen()
    assert rig.notices == [(1, 15, 15)], "at most twice a second"
    rig.pass_time(0.4)
    assert rig.notices == [(1, 15, 15), (1, 1, 16)]


def test_a_slow_viewer_keeps_the_newest_of_mode_latest_and_lost_nothing() -> None:
    rig = Rig(make_subscription(latest=True))
    rig.sink.shut()
    for seq in range(1, 50):
        rig.hub.publish(make_run(seq, [b"x"]))
        rig.pass_time(0.005)
    rig.sink.reopen()
    assert rig.got() == [(1, 49, b"x")]
    assert rig.notices == []


def test_a_slow_viewer_is_bounded_over_all_its_subscriptions() -> None:
    limits = Limits(viewer_queue_bytes=100_000)
    rig = Rig(*(make_subscription(n, queue_bytes=8 << 20) for n in range(5)), limits=limits)
    rig.sink.shut()
    for seq in range(1, 200):
        rig.hub.publish(make_run(seq, [bytes(5000)]))
        rig.pass_time(0.005)
        assert rig.viewer.size_bytes <= 100_000
    rig.sink.reopen()
    assert {seq for _, seq, _ in rig.got()} >= {199}
    assert rig.viewer.size_bytes == 0


def test_a_slow_viewer_holds_nobody_up_and_its_subscriptions_take_turns() -> None:
    rig, slow = Rig(make_subscription()), ListSink(takes=1)
    viewer = rig.join(slow)
    for number in (1, 2):
        viewer.subscribe(make_subscription(number, queue_bytes=1 << 20))
    for seq in range(1, 11):
        rig.hub.publish(make_run(seq, [b"x"]))
        rig.pass_time(0.005)
    assert [seq for _, seq, _ in rig.got()] == list(range(1, 11))
    for _ in range(4):
        slow.reopen(takes=1)
    assert sorted(sub for sub, _, _ in rig.got(slow)) == [1, 1, 1, 2, 2]


def test_who_comes_goes_or_waits_between_two_ticks_gets_its_own_and_no_more() -> None:
    rig, slow, late = Rig(make_subscription()), ListSink(takes=1), ListSink()
    rig.join(slow).subscribe(make_subscription())
    leaving: list[Viewer] = []
    got: list[tuple[list[int], ...]] = []
    for seq in range(1, 7):
        if seq == 4:
            slow.reopen()
            leaving.append(rig.join(late))
            leaving[0].subscribe(make_subscription())
        if seq == 6:
            leaving[0].close()
        rig.hub.publish(make_run(seq, [b"x"]))
        rig.pass_time(0.005)
        got.append(tuple([number for _, number, _ in rig.got(sink)] for sink in (rig.sink, slow, late)))
    assert got == [
        ([1], [1], []),
        ([2], [], []),
        ([3], [], []),
        ([4], [2, 3, 4], [4]),
        ([5], [5], [5]),
        ([6], [6], []),
    ]


def test_one_sample_larger_than_the_queue_still_passes() -> None:
    rig = Rig(make_subscription(queue_bytes=10))
    rig.sink.shut()
    rig.hub.publish(make_run(1, [bytes(1000), bytes(1000)]))
    rig.pass_time()
    rig.sink.reopen()
    assert [seq for _, seq, _ in rig.got()] == [2]


def test_unsubscribing_frees_what_waits() -> None:
    rig = Rig(make_subscription(1), make_subscription(2))
    rig.sink.shut()
    rig.hub.publish(make_run(1, [bytes(100)] * 3))
    rig.pass_time()
    rig.viewer.unsubscribe(1)
    rig.hub.publish(make_run(4, [b"x"]))
    rig.pass_time(0.005)
    rig.sink.reopen()
    assert {sub for sub, *_ in rig.got()} == {2}
    assert rig.viewer.size_bytes == 0
    with pytest.raises(InvalidRequestError):
        rig.viewer.unsubscribe(1)


def test_a_viewer_that_left_is_forgotten() -> None:
    rig = Rig(make_subscription())
    rig.hub.publish(make_run(1, [b"x"]))
    rig.viewer.close()
    rig.viewer.close()
    rig.pass_time()
    rig.hub.publish(make_run(2, [b"x"]))
    rig.pass_time(0.01)
    assert (rig.got(), rig.hub.viewers, rig.hub.wanted([make_channel()])) == ([], 0, {})


def test_ids_are_unique_and_bounded() -> None:
    rig = Rig(make_subscription(1), limits=Limits(subscriptions_per_viewer=2))
    with pytest.raises(InvalidRequestError):
        rig.viewer.subscribe(make_subscription(1))
    rig.viewer.subscribe(make_subscription(2))
    with pytest.raises(TooManyError):
        rig.viewer.subscribe(make_subscription(3))


def test_blocks_are_cut_at_a_quarter_mebibyte() -> None:
    rig = Rig(make_subscription())
    rig.hub.publish(make_run(1, [bytes(100_000)] * 20))
    rig.pass_time()
    assert max(len(data) for data in rig.sink.frames) < 300_000
    assert [seq for _, seq, _ in rig.got()] == list(range(1, 21))


def test_interest_is_reported_and_becomes_demand() -> None:
    rig, changes = Rig(), []
    rig.hub.on_interest = lambda: changes.append(1)
    rig.viewer.subscribe(make_subscription(1, "/r/*", max_rate_hz=5))
    rig.viewer.subscribe(make_subscription(2, "/r/scan", max_rate_hz=10))
    channels = [make_channel("/r/scan"), make_channel("/r/odom"), make_channel("/q/other")]
    assert rig.hub.wanted(channels) == {"/r/scan": 10, "/r/odom": 5}
    rig.viewer.unsubscribe(2)
    assert rig.hub.wanted(channels) == {"/r/scan": 5, "/r/odom": 5}
    assert len(changes) == 3


def test_metric_subscription_merges_and_paces() -> None:
    feed = MetricSubscription(4, Glob("r*"), [Glob("battery.*", separator=".")], max_rate_hz=2)
    assert not feed.offer("other", {"battery.v": (1, 1.0)})
    assert not feed.offer("r1", {"host.cpu": (1, 1.0)})
    assert feed.offer("r1", {"battery.v": (1_000_000, 1.0), "host.cpu": (1, 1.0)})
    (message,) = feed.take(0.0)
    assert message == {"op": "metrics", "id": 4, "robot": "r1", "stamp_ms": 1.0, "values": {"battery.v": 1.0}}
    feed.offer("r1", {"battery.v": (2_000_000, 2.0)})
    feed.offer("r1", {"battery.w": (3_000_000, 3.0)})
    assert (feed.take(0.4), feed.due_s()) == ([], 0.5)
    assert feed.take(0.5)[0]["values"] == {"battery.v": 2.0, "battery.w": 3.0}


def test_feeds_gather_what_is_due() -> None:
    feeds = Feeds()
    assert feeds.due_s() is None
    feeds.add(MetricSubscription(4, Glob("*"), [Glob("**", separator=".")], max_rate_hz=2))
    feeds.add(FleetSubscription(5, revisions=lambda: {"a": 1}, describe=lambda robot: {"id": robot}))
    assert feeds.offer("r1", {"battery.v": (1, 1.0)})
    assert [message["op"] for message in feeds.take(0.0)] == ["metrics", "fleet"]
    feeds.remove(5)
    assert (feeds.take(9.0), len(feeds), 4 in feeds, 5 in feeds) == ([], 1, True, False)


def test_fleet_subscription_tells_all_then_changes() -> None:
    revisions = {"a": 1, "b": 1}
    feed = FleetSubscription(1, revisions=lambda: revisions, describe=lambda robot: {"id": robot})
    assert [robot["id"] for robot in feed.take(0.0)[0]["robots"]] == ["a", "b"]
    revisions["b"] = 2
    assert feed.take(0.4) == []
    assert feed.take(0.5)[0]["robots"] == [{"id": "b"}]
    assert feed.take(1.0) == []


@given(st.lists(st.tuples(st.integers(0, 2**32 - 1), st.binary(max_size=50)), max_size=10))
def test_records_survive_the_frame(items: list[tuple[int, bytes]]) -> None:
    frame = b"".join(
        b"".join(record_parts([Record(n, -n, n, payload)], subscription=n, channel=7)) for n, payload in items
    )
    assert len(frame) % 8 == 0
    assert [(n, r.seq, r.stamp_ns, r.payload) for n, _, r in split_records(frame)] == [(n, n, -n, p) for n, p in items]


@given(st.binary(max_size=200))
@settings(max_examples=100)
def test_garbage_records_are_refused(frame: bytes) -> None:
    try:
        for _, _, record in split_records(frame):
            assert len(record.payload) <= len(frame) - HEADER.size
    except FrameError:
        pass
