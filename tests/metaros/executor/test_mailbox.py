"""Mailboxes: bounded in count and in bytes, and they say how much they dropped."""

from __future__ import annotations

from collections import deque
from itertools import repeat
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.executor import ChannelMailbox, Mailbox


def mailbox(depth: int | None, limit_bytes: int = 1000) -> Mailbox:
    return Mailbox(lambda item: None, owner=None, depth=depth, limit_bytes=limit_bytes, size_of=len)


def test_keep_last_keeps_the_newest():
    box = mailbox(3)
    box.pending.extend([b"1", b"2", b"3", b"4", b"5"])
    box.trim()
    assert list(box.pending) == [b"3", b"4", b"5"]
    assert box.dropped == 2


def test_a_burst_before_an_executor_that_looks_is_dropped_when_it_is_late():
    box = mailbox(3)
    box.pending.extend([b"1", b"2", b"3", b"4", b"5"])
    box.trim(looking_s=100.0)
    assert (len(box.pending), box.dropped) == (5, 0)
    box.trim(looking_s=100.005)
    assert (len(box.pending), box.dropped) == (5, 0)
    box.trim(looking_s=100.02)
    assert list(box.pending) == [b"3", b"4", b"5"]
    assert (box.dropped, box.late_s) == (2, 0.0)


def test_who_takes_from_a_burst_drops_it_when_it_is_late_and_may_catch_up():
    box = mailbox(3)
    box.pending.extend([b"1", b"2", b"3", b"4", b"5"])
    box.trim(looking_s=1.0)  # long ago, by the clock
    box.drop_late()
    assert (list(box.pending), box.late_s) == ([b"3", b"4", b"5"], 0.0)
    box.pending.append(b"6")
    box.trim(looking_s=1.0)
    box.pending.popleft()
    box.drop_late()
    assert (len(box.pending), box.dropped, box.late_s) == (3, 2, 0.0)


def channelled(channel: deque[bytes], limit_bytes: int = 1 << 20) -> ChannelMailbox:
    box = ChannelMailbox(lambda item: None, owner=None, depth=None, limit_bytes=limit_bytes, size_of=len)
    box.channels = (lambda: channel.popleft() if channel else None,)
    return box


def test_a_channel_is_emptied_as_far_as_items_are_handled():
    channel = deque(number.to_bytes(2, "big") for number in range(1000))
    box = channelled(channel)
    box.refill()
    box.refill()
    assert (len(box.pending), len(channel)) == (512, 488)
    taken = [box.pending.popleft() for _ in range(100)]
    box.refill()
    assert (len(box.pending), len(channel)) == (512, 388)
    assert [*taken, *box.pending, *channel] == [number.to_bytes(2, "big") for number in range(1000)]


def test_of_large_items_no_more_are_taken_out_than_fit():
    channel = deque(repeat(bytes(300), 20))
    box = channelled(channel, limit_bytes=1000)
    for _ in range(3):
        box.refill()
    assert (len(box.pending), len(channel)) == (3, 17)


def test_a_channel_whose_executor_is_stuck_is_emptied_within_the_bounds():
    channel = deque(repeat(bytes(300), 20))
    box = channelled(channel, limit_bytes=1000)
    box.refill()
    assert not box.relieve(now_s=1.0)
    assert not box.relieve(now_s=1.05)
    assert box.relieve(now_s=1.2)
    assert (len(box.pending) + box.dropped, len(channel)) == (20, 0)
    assert len(box.pending) <= 3
    box.pending.popleft()
    assert not box.relieve(now_s=1.3)


def test_keep_all_keeps_what_fits():
    box = mailbox(None)
    for number in range(500):
        box.pending.append(number.to_bytes(2, "big"))
        box.trim()
    assert box.dropped == 0
    assert len(box.pending) == 500


def test_bytes_bound_both():
    for depth in (None, 100):
        box = mailbox(depth)
        for _ in range(10):
            box.pending.append(bytes(300))
            box.trim()
        assert sum(map(len, box.pending)) <= 1000
        assert len(box.pending) >= 2
        assert box.dropped == 10 - len(box.pending)


def test_an_executor_may_take_the_last_while_it_is_weighed():
    class Taken(deque[Any]):
        """Somebody takes all that waits in the moment before one looks."""

        def __getitem__(self, index: Any) -> Any:
            self.clear()
            return super().__getitem__(index)

    box = mailbox(None)
    box.pending = Taken([b"1"])
    box.trim()
    assert (len(box.pending), box.dropped) == (0, 0)


def test_the_newest_stays_even_alone_over_the_bound():
    box = mailbox(None)
    box.pending.extend([b"x", bytes(2000)])
    box.trim()
    assert list(box.pending) == [bytes(2000)]


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(0, 400), st.integers(0, 3)), max_size=400), st.sampled_from([None, 1, 7, 300]))
def test_nothing_vanishes_and_the_order_stays(steps, depth):
    box = mailbox(depth, limit_bytes=64 * 400)
    sent = handled = 0
    seen: list[int] = []
    for size, take in steps:
        box.pending.append(sent.to_bytes(4, "big") + bytes(size))
        sent += 1
        box.trim()
        for _ in range(min(take, len(box.pending))):
            seen.append(int.from_bytes(box.pending.popleft()[:4], "big"))
            handled += 1
    assert handled + len(box.pending) + box.dropped == sent
    assert seen == sorted(seen)
    assert depth is None or len(box.pending) <= depth
