"""Filters that keep and hand on."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from metaros.ros2.message_filters import Cache, Chain, SimpleFilter, Subscriber
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rosidl.catalogue import interface


def message(seconds: float) -> Any:
    return SimpleNamespace(header=SimpleNamespace(stamp=at(seconds)), seconds=seconds)


def at(seconds: float) -> Time:
    return Time(seconds=seconds)


def filled(size: int, *times: float) -> Cache:
    source = SimpleFilter()
    cache = Cache(source, size)
    for seconds in times:
        source.signalMessage(message(seconds))
    return cache


def seconds(messages: Any) -> list[float]:
    return [one.seconds for one in messages]


def test_messages_are_asked_for_by_time() -> None:
    cache = filled(100, 1, 2, 5, 3, 4)
    assert seconds(cache.getInterval(at(2), at(4))) == [2, 3, 4]
    assert seconds(cache.getInterval(at(2.1), at(2.2))) == []
    assert seconds(cache.getSurroundingInterval(at(2.1), at(3.9))) == [2, 3, 4]
    assert seconds(cache.getSurroundingInterval(at(0), at(9))) == [1, 2, 3, 4, 5]
    assert cache.getElemAfterTime(at(2)).seconds == 2
    assert cache.getElemAfterTime(at(2.1)).seconds == 3
    assert cache.getElemAfterTime(at(6)) is None
    assert cache.getElemBeforeTime(at(2)).seconds == 2
    assert cache.getElemBeforeTime(at(2.9)).seconds == 2
    assert cache.getElemBeforeTime(at(0.5)) is None
    assert (cache.getOldestTime(), cache.getLastestTime(), cache.getLatestTime()) == (at(1), at(5), at(5))
    assert cache.getLast().seconds == 5
    with pytest.raises(AssertionError):
        cache.getInterval(at(4), at(2))


def test_it_has_a_size_and_may_be_empty() -> None:
    assert seconds(filled(2, 1, 2, 3).cache_msgs) == [2, 3]
    empty = filled(2)
    assert (empty.getLast(), empty.getOldestTime(), empty.getLastestTime()) == (None, None, None)


def test_headers_may_be_missing_where_that_is_said() -> None:
    bare = interface("std_msgs/msg/String")()
    source = SimpleFilter()
    strict, lenient = Cache(source, 5), Cache(source, 5, allow_headerless=True)
    source.signalMessage(bare)
    assert strict.cache_msgs == []
    assert lenient.getLast() is bare
    assert lenient.getLastestTime().nanoseconds > 1_600_000_000_000_000_000


def test_a_chain_of_caches() -> None:
    source, out = SimpleFilter(), []
    chain = Chain(source)
    chain.registerCallback(out.append)
    source.signalMessage(message(1))
    first, second = Cache(SimpleFilter(), 5), Cache(SimpleFilter(), 5)
    assert (chain.addFilter(first), chain.addFilter(second)) == (0, 1)
    source.signalMessage(message(2))
    assert seconds(out) == [1, 2]
    assert seconds(first.cache_msgs) == seconds(second.cache_msgs) == [2]
    assert chain.getFilter(1) is second
    with pytest.raises(RuntimeError, match="Already connected"):
        chain.connectInput(source)


def test_callbacks_get_what_they_registered_with() -> None:
    source, out = SimpleFilter(), []
    first = source.registerCallback(lambda *args: out.append(args), "a", 1)
    second = source.registerCallback(lambda *args: out.append(args))
    assert first != second
    source.signalMessage("x", "y")
    source.callbacks.pop(first)
    source.signalMessage("z")
    assert out == [("x", "y", "a", 1), ("x", "y"), ("z",)]


def test_a_subscriber_is_a_subscription() -> None:
    asked = []

    class Node:
        def create_subscription(self, *args: Any, **kwargs: Any) -> Any:
            asked.append((args, kwargs))
            return SimpleNamespace(topic_name="/scan")

    out: list[Any] = []
    subscriber = Subscriber(Node(), str, "scan", qos_profile=7, callback_group="g")
    subscriber.registerCallback(out.append)
    (kind, topic, callback), options = asked[0]
    assert (kind, topic, options) == (str, "scan", {"qos_profile": 7, "callback_group": "g"})
    callback("hello")
    assert out == ["hello"]
    assert (subscriber.getTopic(), subscriber.topic_name) == ("scan", "/scan")
    with pytest.raises(AttributeError):
        subscriber.nothing  # noqa: B018 - that is the test
    Subscriber(Node(), str, "scan")
    Subscriber(Node(), str, "scan", 3)
    assert [options["qos_profile"] for _, options in asked[1:]] == [10, 3]
