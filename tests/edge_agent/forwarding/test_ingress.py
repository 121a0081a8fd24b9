"""The crossing to the event loop: bounded, counted, one wake a batch."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from queue import SimpleQueue
from threading import Event

import pytest

from edge_agent.config.topic_table import TopicTable
from edge_agent.forwarding.channels import Channel, Channels
from edge_agent.forwarding.ingress import GATHER_S, Ingress
from edge_agent.forwarding.pipeline import Arrival
from metaros.clock import ManualClock
from metaros.wire.attachment import pack_attachment
from tests.edge_agent.parts import make_outbox
from tests.support.processes.threads import left_behind, threads_now
from tests.support.waiting import wait_until

GID = bytes(range(16))


@dataclass
class Sample:
    """As much of a Zenoh sample as the ingress reads."""

    key_expr: str
    payload: bytes
    attachment: bytes | None


def sample(key: str = "a", payload: bytes = b"x", attachment: bytes | None = pack_attachment(1, 77, GID)) -> Sample:
    return Sample(key, payload, attachment)


class Rig:
    def __init__(self) -> None:
        channel = Channels(TopicTable(), make_outbox().ids, namespace="/").observe(
            "/a", "a/msg/A", "x", qos="", keeps_all=False
        )
        assert channel is not None
        self.channel: Channel = channel
        self.wakes: list[Callable[[], None]] = []
        self.taken: list[Arrival] = []
        self.gids: list[bytes] = []
        self.ingress = Ingress(self.route, self.take, self.wakes.append, ManualClock(), max_bytes=100)

    def route(self, key: str, gid: bytes) -> Channel | None:
        self.gids.append(gid)
        return self.channel if key == "a" else None

    def take(self, arrivals: list[Arrival], now_s: float) -> None:
        self.taken += arrivals

    def put(self, *samples: Sample) -> None:
        """Queue samples and wait until the thread has read them all."""
        for item in samples:
            self.ingress.sink(item)
        marker = sample("marker")
        self.ingress.sink(marker)
        seen = len(self.gids)
        wait_until(lambda: self.ingress._queue.empty() and len(self.gids) >= seen)


@pytest.fixture
def rig() -> Iterator[Rig]:
    before = threads_now()
    rig = Rig()
    yield rig
    rig.ingress.close()
    assert left_behind(before, "tap-drain") == []


def test_samples_cross_with_stamp_and_size(rig: Rig) -> None:
    rig.put(sample(payload=b"hello"), sample("elsewhere"))
    wait_until(lambda: rig.wakes)
    rig.wakes[0]()
    (arrival,) = rig.taken
    assert (bytes(arrival.payload), arrival.size_bytes, arrival.stamp_ns) == (b"hello", 5, 77)
    assert arrival.arrived_s == 1000.0
    assert rig.gids[0] == GID


def test_one_wake_until_the_loop_has_taken(rig: Rig) -> None:
    for _ in range(5):
        rig.put(sample())
    wait_until(lambda: rig.wakes)
    assert len(rig.wakes) == 1
    rig.wakes[0]()
    rig.put(sample())
    wait_until(lambda: len(rig.wakes) == 2)


def test_what_does_not_fit_is_dropped_and_counted(rig: Rig) -> None:
    rig.put(*[sample(payload=bytes(40)) for _ in range(5)])
    wait_until(lambda: rig.wakes and len(rig.gids) == 6)
    rig.wakes[0]()
    assert len(rig.taken) == 2
    assert (rig.channel.dropped, rig.channel.messages) == (3, 3)
    rig.put(sample())
    wait_until(lambda: len(rig.wakes) == 2)
    rig.wakes[1]()
    assert (len(rig.taken), rig.channel.dropped) == (3, 3)


@pytest.mark.parametrize("attachment", [None, b"", b"short", bytes(33), bytes(77)])
def test_a_bad_attachment_is_counted(rig: Rig, attachment: bytes | None) -> None:
    rig.put(sample(attachment=attachment), sample())
    wait_until(lambda: rig.wakes)
    assert rig.ingress.malformed == {"a": 1}


class _Bell:
    """Stands in for the ingress's: what gathers waits until the test says so."""

    def __init__(self) -> None:
        self.waits: SimpleQueue[float] = SimpleQueue()
        self.rung = Event()

    def wait(self, timeout_s: float) -> None:
        self.waits.put(timeout_s)
        self.rung.wait(60)

    def set(self) -> None:
        self.rung.set()

    def clear(self) -> None:
        self.rung.clear()


@pytest.mark.parametrize("how", ["watched", "urgent"])
def test_unwatched_samples_gather_until_somebody_wants_them(rig: Rig, how: str) -> None:
    bell = rig.ingress._bell = _Bell()  # type: ignore[assignment]
    rig.ingress._watched = lambda: False
    rig.ingress.sink(sample())
    assert bell.waits.get(timeout=60) == GATHER_S
    rig.ingress.sink(sample(payload=b"2"))
    assert rig.gids == []
    if how == "watched":
        rig.ingress.hurry()
    else:
        rig.ingress.urgent_sink(sample(payload=b"3"))
    wait_until(lambda: len(rig.gids) >= 2)
