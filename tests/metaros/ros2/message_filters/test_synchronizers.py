"""Synchronizers against the dullest search there is, on seeded streams."""

from __future__ import annotations

import itertools
import random  # noqa: TID251 - seeded here
from dataclasses import dataclass
from typing import Any

import pytest

from metaros.ros2.message_filters import ApproximateTimeSynchronizer, SimpleFilter, TimeSynchronizer
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rosidl.catalogue import interface


@dataclass(eq=False)
class Header:
    stamp: Any


@dataclass(eq=False)
class Message:
    header: Header
    name: str

    def __repr__(self) -> str:
        return self.name


def message(time_ns: int, name: str = "") -> Message:
    return Message(Header(Time(nanoseconds=time_ns)), name or str(time_ns))


def synchronized(kind: Any, inputs: int, *args: Any, **kwargs: Any) -> tuple[list[SimpleFilter], list[tuple[Any, ...]]]:
    filters, out = [SimpleFilter() for _ in range(inputs)], []
    kind(filters, *args, **kwargs).registerCallback(lambda *messages: out.append(messages))
    return filters, out


def test_messages_of_one_time_come_out_together() -> None:
    (left, right), out = synchronized(TimeSynchronizer, 2, 10)
    ours, theirs = [message(t) for t in range(5)], [message(t) for t in (4, 2, 9, 0)]
    for one in ours:
        left.signalMessage(one)
    assert out == []
    for one in theirs:
        right.signalMessage(one)
    assert out == [(ours[4], theirs[0]), (ours[2], theirs[1]), (ours[0], theirs[3])]


def test_of_each_input_the_newest_times_wait() -> None:
    (left, right), out = synchronized(TimeSynchronizer, 2, 2)
    for t in (1, 2, 3):
        left.signalMessage(message(t))
    for t in (1, 2, 3):
        right.signalMessage(message(t))
    assert [str(messages) for messages in out] == ["(2, 2)", "(3, 3)"]


def test_stamps_are_messages_too_and_what_has_none_is_left_out() -> None:
    filters, out = synchronized(TimeSynchronizer, 1, 2)
    stamped = interface("geometry_msgs/msg/PoseStamped")()
    stamped.header.stamp.sec = 4
    filters[0].signalMessage(stamped)
    filters[0].signalMessage(interface("std_msgs/msg/String")())
    assert out == [(stamped,)]


def test_a_callback_may_feed_the_synchronizer_and_one_that_fails_leaves_it_whole() -> None:
    filters = [SimpleFilter(), SimpleFilter()]
    out = []

    def callback(a: Message, b: Message) -> None:
        out.append((a, b))
        if len(out) == 1:
            filters[0].signalMessage(message(7))
            filters[1].signalMessage(message(7))
            raise ValueError("of the callback")

    TimeSynchronizer(filters, 5).registerCallback(callback)
    filters[0].signalMessage(message(1))
    with pytest.raises(ValueError, match="of the callback"):
        filters[1].signalMessage(message(1))
    filters[0].signalMessage(message(2))
    filters[1].signalMessage(message(2))
    assert [str(messages) for messages in out] == ["(1, 1)", "(7, 7)", "(2, 2)"]


def test_slop_is_a_bound_that_is_not_reached() -> None:
    (left, right), out = synchronized(ApproximateTimeSynchronizer, 2, 10, slop=1.001e-7)
    left.signalMessage(message(0))
    right.signalMessage(message(100))
    assert out == []
    right.signalMessage(message(99))
    assert [str(messages) for messages in out] == ["(0, 99)"]


def test_what_has_no_header_counts_from_when_it_came() -> None:
    (left, right), out = synchronized(ApproximateTimeSynchronizer, 2, 10, 60.0)
    bare = interface("std_msgs/msg/String")(data="x")
    left.signalMessage(bare)
    right.signalMessage(bare)
    assert out == []
    for options in ({"allow_headerless": True}, {"sync_arrival_time": True}):
        (left, right), out = synchronized(ApproximateTimeSynchronizer, 2, 10, 60.0, **options)
        left.signalMessage(bare)
        right.signalMessage(bare if "allow_headerless" in options else message(1))
        assert len(out) == 1, options


class Dull:
    """Keeps lists, tries every combination in the order the documentation gives, and takes the first."""

    def __init__(self, inputs: int, size: int, slop_ns: int) -> None:
        self.waiting: list[list[Message]] = [[] for _ in range(inputs)]
        self.size, self.slop_ns = size, slop_ns

    def put(self, index: int, new: Message) -> tuple[Message, ...] | None:
        def t(one: Message) -> int:
            return int(one.header.stamp.nanoseconds)

        queue = self.waiting[index]
        same = [place for place, one in enumerate(queue) if t(one) == t(new)]
        if same:
            queue[same[0]] = new
        else:
            queue.append(new)
        if len(queue) > self.size:
            queue.remove(min(queue, key=t))
        near = [sorted(queue, key=lambda one: abs(t(one) - t(new))) for queue in self.waiting]
        near[index] = [new] if new in queue else []
        for messages in itertools.product(*near):
            times = [t(one) for one in messages]
            if max(times) - min(times) < self.slop_ns:
                for queue, one in zip(self.waiting, messages, strict=True):
                    queue.remove(one)
                return messages
        return None


def test_against_every_combination() -> None:
    sets = 0
    for seed in range(60):
        rng = random.Random(seed)
        inputs, size, slop_ns = rng.randint(1, 4), rng.randint(1, 6), rng.choice([1, 20, 60, 200])
        filters, out = synchronized(ApproximateTimeSynchronizer, inputs, size, (slop_ns + 0.5) / 1e9)
        dull, expected = Dull(inputs, size, slop_ns), []
        streams = [
            [max(0, 100 * k + rng.randint(-60, 60)) for k in range(25) if rng.random() < 0.9] for _ in range(inputs)
        ]
        arrivals = [(index, t) for index, stream in enumerate(streams) for t in stream]
        arrivals.sort(key=lambda one: one[1] + rng.randint(0, 250))
        for number, (index, t) in enumerate(arrivals):
            new = message(t, f"{index}:{t}#{number}")
            if found := dull.put(index, new):
                expected.append(found)
            filters[index].signalMessage(new)
            assert out == expected, f"seed {seed}, message {number}: {new}"
        sets += len(out)
    assert sets > 500


def test_exact_times_against_every_combination() -> None:
    for seed in range(30):
        rng = random.Random(seed)
        inputs, size = rng.randint(1, 4), rng.randint(1, 8)
        filters, out = synchronized(TimeSynchronizer, inputs, size)
        dull, expected = Dull(inputs, size, 1), []
        for number in range(80):
            index, t = rng.randrange(inputs), rng.randrange(20)
            new = message(t, f"{index}:{t}#{number}")
            if found := dull.put(index, new):
                expected.append(found)
            filters[index].signalMessage(new)
            assert out == expected, f"seed {seed}, message {number}: {new}"


def test_many_candidates_take_no_time() -> None:
    filters, out = synchronized(ApproximateTimeSynchronizer, 8, 60, 100e-9)
    for k in range(60):
        for index in range(7):
            filters[index].signalMessage(message(1000 + k + 90 * (index % 2)))
    filters[7].signalMessage(message(1000 + 59 - 99))
    assert out == [], "60 to the power of 7 combinations, and none of them is near enough"
