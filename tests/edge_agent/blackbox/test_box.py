"""The black box's thread: everything in order, a bounded queue, and an agent that goes on whatever happens to it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from edge_agent.blackbox import box as box_module
from edge_agent.blackbox.box import OVERHEAD_BYTES, BlackBox
from edge_agent.blackbox.mcap_reader import records
from edge_agent.blackbox.ring import Ring
from edge_agent.config.black_box import BlackBoxSettings
from edge_agent.errors import BlackBoxOffError
from metaros.clock import SystemClock
from metaros.record.bag_index import read_index
from tests.edge_agent.blackbox.rig import arrival, channel_of
from tests.support.processes.threads import left_behind, threads_now
from tests.support.waiting import wait_until

MakeBox = Callable[..., BlackBox]
TIB = 1 << 40


@pytest.fixture
def make_box(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[MakeBox]:
    monkeypatch.setattr(box_module, "GATHER_S", 0.01)
    monkeypatch.setattr(box_module, "TICK_S", 0.02)
    before = threads_now()
    made: list[BlackBox] = []

    def ring() -> Ring:
        return Ring(tmp_path, SystemClock(), window_s=60.0, limit_bytes=8 << 20, free=lambda: (TIB, TIB))

    def make(open_ring: Callable[[], Ring] = ring, queue_bytes: int = 1 << 20, **settings: object) -> BlackBox:
        box = BlackBox(
            BlackBoxSettings(**settings),  # type: ignore[arg-type]
            open_ring,
            SystemClock(),
            queue_bytes=queue_bytes,
        )
        made.append(box)
        box.start()
        return box

    yield make
    for box in made:
        box.close()
    assert left_behind(before, "black-box") == []


def held(box: BlackBox) -> list[tuple[str, int, bytes]]:
    """Everything that came until now."""
    found = box.hold().result(60)
    try:
        return [
            (record.channel.topic, record.sequence, record.payload)
            for piece in found.files
            for record in records(read_index(piece.path))
        ]
    finally:
        box.release()


def test_batches_are_written_in_order(make_box: MakeBox) -> None:
    box, channel = make_box(), channel_of("/odom")
    for first in range(1, 1001, 10):
        box.take([arrival(channel, number, b"%d" % number) for number in range(first, first + 10)])
    assert held(box) == [("/odom", number, b"%d" % number) for number in range(1, 1001)]


def test_topics_and_exclude_choose(make_box: MakeBox) -> None:
    box = make_box(topics=("/a/**",), exclude=("**/raw",))
    for topic in ("/a/scan", "/a/raw", "/b/scan"):
        box.take([arrival(channel_of(topic), 1, b"x")])
    assert held(box) == [("/a/scan", 1, b"x")]


def test_what_finds_the_queue_full_is_counted_and_noted(make_box: MakeBox, tmp_path: Path) -> None:
    channel, gate = channel_of("/odom"), threading.Event()

    def slow_ring() -> Ring:
        gate.wait(60)
        return Ring(tmp_path, SystemClock(), window_s=60.0, limit_bytes=8 << 20, free=lambda: (TIB, TIB))

    box = make_box(slow_ring, queue_bytes=10 * (OVERHEAD_BYTES + 100))
    for number in range(1, 16):
        box.take([arrival(channel, number, bytes(100))])
    gate.set()
    found = box.hold().result(60)
    assert box.describe().lost == 5
    (publisher,) = found.publishers.values()
    assert publisher.reasons(11, 15) == {"dropped": [[11, 15]]}
    box.take([arrival(channel, 16, b"again")])
    assert [sequence for _, sequence, _ in held(box)] == [*range(1, 11), 16]


def test_a_ring_that_cannot_be_opened_ends_nothing_else(make_box: MakeBox) -> None:
    def broken() -> Ring:
        raise PermissionError("not yours")

    box, channel = make_box(broken), channel_of("/odom")
    waiting = box.hold()
    with pytest.raises(BlackBoxOffError, match="not yours"):
        waiting.result(60)
    for first in range(0, 160, 32):  # more than the queue would take if nobody took from it
        box.take([arrival(channel, first + number, bytes(16 * 1024)) for number in range(32)])
        wait_until(lambda: box._waiting_bytes == 0)
    assert "not yours" in box.trouble
    box.close()
    with pytest.raises(BlackBoxOffError, match="closed"):
        box.hold().result(60)


def test_it_says_what_it_holds(make_box: MakeBox) -> None:
    box = make_box(quota_bytes=8 << 20)
    before_ns = SystemClock().wall_ns()
    box.take([arrival(channel_of("/odom"), 1, b"x")])
    wait_until(lambda: box.describe().to_ns > 0)
    said = box.describe()
    assert before_ns <= said.from_ns == said.to_ns <= SystemClock().wall_ns()
    assert (said.quota_bytes, said.lost, said.size_bytes > 0) == (8 << 20, 0, True)
