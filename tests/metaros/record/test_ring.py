"""The last seconds, bounded in time and bytes; latched samples stay."""

from __future__ import annotations

from metaros.interfaces.std_msgs.msg import String
from metaros.record.ring import Ring
from metaros.wire import qos_transient_local
from tests.support.nodes.bags import arrivals


def stream(count: int, size: int = 100, topic: str = "/a") -> list:
    return arrivals(topic, [String(data="x" * size)] * count, step_ns=100_000_000)


def test_bounded_in_time() -> None:
    ring = Ring(window_s=1.0, limit_bytes=1 << 20)
    for item in stream(50):
        ring.add(*item)
    assert [arrival.sequence for arrival, _ in ring.items()] == list(range(40, 51))
    assert ring.span_s() == 1.0
    assert ring.evicted_early == 0


def test_the_order_is_that_of_arrival_whatever_the_publishers_clocks_say() -> None:
    ring = Ring(window_s=10.0, limit_bytes=1 << 20)
    ahead_ns = 3_600_000_000_000
    ours, theirs = stream(4), stream(4, topic="/b")
    of_both = [item for pair in zip(theirs, ours, strict=True) for item in pair]
    for arrival, payload in of_both:
        late_ns = ahead_ns if arrival.route.topic == "/b" else 0
        ring.add(arrival._replace(publish_ns=arrival.publish_ns + late_ns), payload)
    assert [(arrival.route.topic, arrival.sequence) for arrival, _ in ring.items()] == [
        (topic, number) for number in range(1, 5) for topic in ("/b", "/a")
    ]


def test_bounded_in_bytes() -> None:
    ring = Ring(window_s=100.0, limit_bytes=10_000)
    for item in stream(50, size=1000):
        ring.add(*item)
        assert ring.size_bytes <= 10_000
    assert ring.evicted_early > 0
    assert [arrival.sequence for arrival, _ in ring.items()][-1] == 50


def test_latched_samples_stay() -> None:
    ring = Ring(window_s=1.0, limit_bytes=1 << 20)
    latched = stream(3, topic="/map")
    latched[0][0].route.qos = [qos_transient_local]
    for item in [*latched, *stream(50)[3:]]:
        ring.add(*item)
    assert [a.sequence for a, _ in ring.items() if a.route.topic == "/map"] == [3]


def test_latched_samples_give_way_to_the_bound() -> None:
    ring = Ring(window_s=0.1, limit_bytes=3000)
    latched = stream(1, size=1000, topic="/map")
    latched[0][0].route.qos = [qos_transient_local]
    for item in [*latched, *stream(50, size=2000)[3:]]:
        ring.add(*item)
    assert ring.size_bytes <= 3000
    assert [a.route.topic for a, _ in ring.items()] == ["/a"]
