"""Decoded views: once per sample for all, quick ones at once, slow ones in a thread, in order and bounded."""

from __future__ import annotations

import asyncio
import threading
from dataclasses import dataclass
from typing import Any, ClassVar

import pytest

from gateway.domain.channel import Channel
from gateway.domain.records import Record
from gateway.live.encoding import Block, View
from gateway.live.hub import Hub
from gateway.live.subscription import TopicSubscription
from metaros.clock import SystemClock
from tests.support.gateways.hub_rig import ListSink, make_run

made_by: list[str] = []
gate = threading.Event()


def noted(_channel: Channel, record: Record) -> bytes:
    made_by.append(threading.current_thread().name)
    return b"<%d>" % record.seq


def gated(channel: Channel, record: Record) -> bytes:
    assert gate.wait(60)
    return noted(channel, record)


def held_up(channel: Channel, record: Record) -> bytes:
    threading.Event().wait(0.02)  # as if another process had the CPU
    return noted(channel, record)


def failing(_channel: Channel, record: Record) -> bytes:
    if record.seq == 2:
        raise ValueError("no such message")
    return b"<%d>" % record.seq


@dataclass(frozen=True)
class Shown:
    """Joins the views of a block's samples."""

    view: ClassVar[View[Any] | None] = noted
    number: int = 1

    def encode(self, block: Block) -> bytes:
        return b"%d:" % self.number + b"".join(made or b"-" for made in block.views(type(self).view or noted))


@dataclass(frozen=True)
class ShownLate(Shown):
    view: ClassVar[View[Any] | None] = gated


@dataclass(frozen=True)
class ShownHeldUp(Shown):
    view: ClassVar[View[Any] | None] = held_up


@dataclass(frozen=True)
class ShownHalf(Shown):
    view: ClassVar[View[Any] | None] = failing


@pytest.fixture(autouse=True)
def _fresh() -> None:
    made_by.clear()
    gate.clear()


def watch(hub: Hub, encoding: Shown, **options: Any) -> ListSink:
    sink = ListSink()
    hub.join(sink).subscribe(TopicSubscription(encoding.number, lambda _: True, lambda _: encoding, **options))
    return sink


def taken(sink: ListSink) -> bytes:
    return b"".join(sink.frames)


async def until(hub: Hub, sink: ListSink, data: bytes) -> None:
    """Until the sink has it; the hub's thread tells the loop."""
    async with asyncio.timeout(60):
        while taken(sink) != data:
            done = asyncio.Event()
            hub.later(0.005, done.set)
            await done.wait()


class _Never:
    def cancel(self) -> None:
        """Nothing is set."""


def test_a_view_is_made_once_for_all_encodings_rates_and_viewers() -> None:
    hub = Hub(clock=SystemClock(), later=lambda _s, _call: _Never())
    sinks = [watch(hub, Shown(number), max_rate_hz=rate) for number, rate in ((1, 0.0), (1, 0.0), (2, 0.0), (3, 1.0))]
    hub.publish(make_run(1, [b"a", b"b"], step_ns=2 * 10**9))
    hub.flush()
    assert [taken(sink) for sink in sinks] == [b"1:<1><2>", b"1:<1><2>", b"2:<1><2>", b"3:<1><2>"]
    assert made_by == [threading.current_thread().name] * 2


def test_a_view_that_had_to_wait_for_the_cpu_is_not_taken_for_a_slow_one() -> None:
    hub = Hub(clock=SystemClock(), later=lambda _s, _call: _Never())
    sink = watch(hub, ShownHeldUp())
    for seq in (1, 2):
        hub.publish(make_run(seq, [b"a"]))
        hub.flush()
    assert taken(sink) == b"1:<1>1:<2>"
    assert made_by == [threading.current_thread().name] * 2


def test_a_sample_that_cannot_be_shown_is_left_out() -> None:
    hub = Hub(clock=SystemClock(), later=lambda _s, _call: _Never())
    sink = watch(hub, ShownHalf())
    hub.publish(make_run(1, [b"a", b"b", b"c"]))
    hub.flush()
    assert taken(sink) == b"1:<1>-<3>"


async def test_large_samples_are_shown_by_the_thread_in_order_and_hold_nobody_up() -> None:
    hub = Hub(clock=SystemClock())
    late, plain = watch(hub, ShownLate()), watch(hub, Shown(2))
    hub.publish(make_run(1, [bytes(100_000)]))
    hub.flush()
    hub.publish(make_run(2, [b"small"]))
    hub.flush()
    gate.set()
    await until(hub, late, b"1:<1>1:<2>")
    await until(hub, plain, b"2:<1>2:<2>")
    assert threading.current_thread().name not in made_by[:1]
    hub.close()


async def test_what_waits_for_the_thread_is_bounded_and_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    hub, notices = Hub(clock=SystemClock()), []
    sink = ListSink()
    viewer = hub.join(sink, on_dropped=lambda *notice: notices.append(notice))
    viewer.subscribe(TopicSubscription(1, lambda _: True, lambda _: ShownLate()))
    for seq in range(1, 13):
        hub.publish(make_run(seq, [bytes(1_000_000)]))
        hub.flush()
    gate.set()
    await until(hub, sink, b"1:<1>" + b"".join(b"1:<%d>" % seq for seq in range(6, 13)))
    assert notices[0] == (1, 1, 1)
    assert viewer.topics[0].dropped == 4
    hub.close()


async def test_of_the_latest_only_the_newest_waits_for_the_thread() -> None:
    hub = Hub(clock=SystemClock())
    sink = watch(hub, ShownLate(), latest=True)
    for seq in range(1, 13):
        hub.publish(make_run(seq, [bytes(100_000)]))
        hub.flush()
    gate.set()
    await until(hub, sink, b"1:<1>1:<12>")
    hub.close()
