"""Fan-out: who gets what, how fast, and how much may wait."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.domain.channel import Channel
from gateway.domain.records import HEADER, Record, record_parts, split_records
from gateway.domain.sample import Run
from gateway.errors import InvalidRequestError, TooManyError
from gateway.live.feeds import FleetSubscription, MetricSubscription
from gateway.live.hub import Hub
from gateway.live.subscription import TopicSubscription
from gateway.live.viewer import Viewer
from metaros.errors import FrameError
from metaros.idl.globs import Glob
from metaros.limits import LIMITS, Limits
from metaros.link import SampleColumns


def make_channel(topic: str = "/r/scan", robot: str = "r") -> Channel:
    return Channel(robot=robot, channel_id=1, topic=topic, schema_name="a/msg/B", type_hash="h", schema=b"int8 x")


def make_run(first_seq: int, payloads: list[bytes], channel: Channel | None = None, *, step_ns: int = 1) -> Run:
    offsets = np.concatenate(([0], np.cumsum([len(p) for p in payloads]))).astype(np.int64)
    columns = SampleColumns(
        stream_id=1,
        epoch=1,
        first_seq=first_seq,
        stamps_ns=np.arange(first_seq, first_seq + len(payloads), dtype=np.int64) * step_ns,
        offsets=offsets,
        payload=b"".join(payloads),
    )
    return Run(channel or make_channel(), columns, 5)


def subscription(number: int = 1, topics: str = "**", **options: Any) -> TopicSubscription:
    chosen = {"max_rate_hz": 0.0, "latest": False, "queue_bytes": 1 << 20, **options}
    return TopicSubscription(number, Glob("*"), Glob(topics), **chosen)


def rig(*subscriptions: TopicSubscription, limits: Limits = LIMITS) -> tuple[Hub, Viewer]:
    hub, viewer = Hub(), Viewer(limits=limits)
    hub.join(viewer, lambda: None)
    for item in subscriptions:
        viewer.add(item)
    hub.changed(viewer)
    return hub, viewer


def drain(viewer: Viewer, now_s: float = 0.0) -> tuple[list[dict[str, Any]], list[tuple[int, int, int, bytes]]]:
    """Everything to write: texts, and (subscription, channel, seq, payload) of records."""
    texts: list[dict[str, Any]] = []
    found = []
    while messages := viewer.take(now_s):
        for message in messages:
            if isinstance(message, str):
                texts.append(json.loads(message))
            else:
                found += [(sub, channel, r.seq, r.payload) for sub, channel, r in split_records(message)]
    return texts, found


def test_queue_keeps_order_and_bytes() -> None:
    hub, viewer = rig(subscription())
    hub.publish(make_run(1, [b"a", b"bb", b"c" * 9]))
    texts, found = drain(viewer)
    assert [(t["op"], t["channel"], t["schema"]) for t in texts] == [("channel", 1, "int8 x")]
    assert found == [(1, 1, 1, b"a"), (1, 1, 2, b"bb"), (1, 1, 3, b"c" * 9)]
    assert viewer.size_bytes == 0
    hub.publish(make_run(4, [b"d"]))
    assert drain(viewer) == ([], [(1, 1, 4, b"d")])


def test_latest_keeps_only_the_newest_of_each_channel() -> None:
    hub, viewer = rig(subscription(latest=True))
    other = make_channel("/r/odom")
    for first in (1, 4):
        hub.publish(make_run(first, [b"x", b"y", b"z"]))
        hub.publish(make_run(first, [b"1", b"2"], other))
    _, found = drain(viewer)
    assert sorted(found) == [(1, 1, 6, b"z"), (1, 2, 5, b"2")]


def test_globs_choose() -> None:
    hub, viewer = rig(subscription(1, "/r/scan"), subscription(2, "/r/*"))
    hub.publish(make_run(1, [b"a"]))
    hub.publish(make_run(1, [b"b"], make_channel("/r/odom")))
    hub.publish(make_run(1, [b"c"], make_channel("/q/odom/deep")))
    assert sorted(drain(viewer)[1]) == [(1, 1, 1, b"a"), (2, 1, 1, b"a"), (2, 2, 1, b"b")]


def test_rate_limit_sends_the_newest_when_it_is_due() -> None:
    hub, viewer = rig(subscription(latest=True, max_rate_hz=10))
    sent = []
    for step in range(100):  # 100 Hz for one second
        hub.publish(make_run(step + 1, [b"x"]))
        sent += [seq for _, _, seq, _ in drain(viewer, step / 100)[1]]
    assert len(sent) == 10
    assert viewer.due_s() == pytest.approx(1.0)
    assert [seq for _, _, seq, _ in drain(viewer, 1.0)[1]] == [100]


def test_a_queue_is_thinned_by_stamps() -> None:
    hub, viewer = rig(subscription(max_rate_hz=10))
    hub.publish(make_run(1, [b"x"] * 50, step_ns=10_000_000))  # 100 Hz in one burst
    assert [seq for _, _, seq, _ in drain(viewer)[1]] == [1, 11, 21, 31, 41]


def test_a_full_queue_drops_the_oldest_and_says_so() -> None:
    hub, viewer = rig(subscription(queue_bytes=10 * 48))
    hub.publish(make_run(1, [b"x"] * 25))
    texts, found = drain(viewer)
    assert [seq for _, _, seq, _ in found] == list(range(16, 26))
    assert texts[-1] == {"op": "dropped", "id": 1, "count": 15, "total": 15}
    hub.publish(make_run(26, [b"x"] * 11))
    assert drain(viewer, 0.1)[0] == []
    assert viewer.due_s() == pytest.approx(0.5)
    assert drain(viewer, 0.5)[0] == [{"op": "dropped", "id": 1, "count": 1, "total": 16}]


def test_a_slow_viewer_is_bounded_over_all_its_subscriptions() -> None:
    limits = Limits(viewer_queue_bytes=100_000)
    hub, viewer = rig(*(subscription(n, queue_bytes=8 << 20) for n in range(5)), limits=limits)
    for seq in range(1, 200):
        hub.publish(make_run(seq, [bytes(5000)]))
        assert viewer.size_bytes <= 100_000
    _, found = drain(viewer)
    assert found[-1][2] == 199
    assert viewer.size_bytes == 0


def test_one_sample_larger_than_the_queue_still_passes() -> None:
    hub, viewer = rig(subscription(queue_bytes=10))
    hub.publish(make_run(1, [bytes(1000), bytes(1000)]))
    assert [seq for _, _, seq, _ in drain(viewer)[1]] == [2]


def test_unsubscribing_frees_what_waits() -> None:
    hub, viewer = rig(subscription(1), subscription(2))
    hub.publish(make_run(1, [bytes(100)] * 3))
    viewer.remove(1)
    hub.changed(viewer)
    hub.publish(make_run(4, [b"x"]))
    assert {sub for sub, *_ in drain(viewer)[1]} == {2}
    assert viewer.size_bytes == 0
    with pytest.raises(InvalidRequestError):
        viewer.remove(1)


def test_ids_are_unique_and_bounded() -> None:
    viewer = Viewer(limits=Limits(subscriptions_per_viewer=2))
    viewer.add(subscription(1))
    with pytest.raises(InvalidRequestError):
        viewer.add(subscription(1))
    viewer.add(subscription(2))
    with pytest.raises(TooManyError):
        viewer.add(subscription(3))


def test_frames_are_cut_at_a_quarter_mebibyte() -> None:
    hub, viewer = rig(subscription(queue_bytes=8 << 20))
    hub.publish(make_run(1, [bytes(100_000)] * 20))
    sizes = []
    while messages := viewer.take(0.0):
        sizes += [len(message) for message in messages if isinstance(message, bytes)]
    assert max(sizes) < 400_000
    assert len(sizes) == 7


def test_demand_of_live_channels() -> None:
    hub, _ = rig(subscription(1, "/r/*", max_rate_hz=5), subscription(2, "/r/scan", max_rate_hz=10))
    channels = [make_channel("/r/scan"), make_channel("/r/odom"), make_channel("/q/other")]
    assert hub.wanted(channels) == {"/r/scan": 10, "/r/odom": 5}


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
        b"".join(record_parts(Record(n, -n, n, payload), subscription=n, channel=7)) for n, payload in items
    )
    assert len(frame) % 8 == 0
    assert [(n, r.seq, r.stamp_ns, r.payload) for n, _, r in split_records(frame)] == [(n, n, -n, p) for n, p in items]


@given(st.binary(max_size=200))
@settings(max_examples=300)
def test_garbage_records_are_refused(frame: bytes) -> None:
    try:
        for _, _, record in split_records(frame):
            assert len(record.payload) <= len(frame) - HEADER.size
    except FrameError:
        pass
