"""Large messages through shared memory: between all kinds of peers, with a full pool, and when processes are killed."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

import metaros
from metaros.interfaces.sensor_msgs.msg import Image
from metaros.wire import Durability, QoSProfile
from metaros.wire.shm import locks_without_limit
from tests.support.nodes import shm_peer
from tests.support.ports import free_port
from tests.support.waiting import wait_until

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not locks_without_limit(), reason="shared memory is used on Linux, by who may lock it"
)
_KILLS = 6


@pytest.fixture
def sharing(island: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[metaros.Context]:
    """A context with shared memory; it and its peers are clients, so all goes through a router that has none."""
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", 'mode="client"')
    with metaros.Context(domain_id=0, connect=island, listen=[], shared_memory="auto") as context:
        yield context


@contextmanager
def child(role: str, endpoint: str) -> Iterator[Any]:
    """A process at the other end, and its lines; killed at the end."""
    command = [sys.executable, "-m", "tests.support.nodes.shm_peer", role, endpoint, str(shm_peer.POOL_BYTES)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()
            process.wait()


def listening(context: metaros.Context, node: metaros.Node, qos: QoSProfile | int = 50) -> list[Any]:
    """What arrives on the topic, on a spinning executor of its own."""
    got: list[Any] = []
    node.create_subscription(Image, shm_peer.TOPIC, lambda message: got.append(message.data), qos)
    threading.Thread(target=metaros.spin, args=(node,), daemon=True).start()
    return got


@pytest.mark.parametrize("mode", ["auto", "off"])
def test_peers_with_and_without_it_get_the_same_through_a_router_that_has_none(sharing, island, mode):
    with (
        metaros.Context(domain_id=0, connect=island, listen=[], shared_memory=mode) as other,
        metaros.Node("receiver", context=other) as node,
    ):
        got = listening(other, node)
        publisher = shm_peer.publisher_of(sharing)
        wait_until(lambda: publisher.events.matched)
        for number in range(5):
            publisher.publish(shm_peer.image(number))
        wait_until(lambda: len(got) == 5)
        assert [(int(data.min()), int(data.max()), len(data)) for data in got] == [
            (number, number, shm_peer.IMAGE_BYTES) for number in range(5)
        ]
        assert sharing.session.shared_pool.placed == 5


def test_between_two_processes_it_is_shared_memory_indeed():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with metaros.Context(domain_id=0, connect=[], listen=endpoint, shared_memory="auto") as context:
        publisher = shm_peer.publisher_of(context)
        with child("hold", endpoint) as holder:
            wait_until(lambda: publisher.events.matched)
            publisher.publish(shm_peer.image(1))
            assert holder.stdout.readline() == "shared\n"


def test_what_is_kept_for_late_subscriptions_is_not_in_the_pool(sharing, island):
    kept = QoSProfile(durability=Durability.TRANSIENT_LOCAL, depth=3)
    with (
        metaros.Context(domain_id=0, connect=island, listen=[]) as other,
        metaros.Node("early", context=sharing) as early,
        metaros.Node("late", context=other) as late,
    ):
        publisher = early.create_publisher(Image, shm_peer.TOPIC, kept)
        for number in range(5):
            publisher.publish(shm_peer.image(number))
        got = listening(other, late, kept)
        # An older one may come as well: it was still on its way when the subscription began.
        wait_until(lambda: [int(data[0]) for data in got][-3:] == [2, 3, 4])
        assert (sharing.session.shared_pool.placed, sharing.session.shared_pool.refused) == (0, 0)


def test_a_slow_subscription_that_holds_the_whole_pool_loses_nothing(sharing, island):
    with (
        metaros.Context(domain_id=0, connect=island, listen=[], shared_memory="auto") as other,
        metaros.Node("slow", context=other) as slow,
    ):
        got: list[int] = []
        slow.create_subscription(Image, shm_peer.TOPIC, lambda message: got.append(int(message.data.max())), 50)
        publisher = shm_peer.publisher_of(sharing)
        wait_until(lambda: publisher.events.matched)
        for number in range(20):
            publisher.publish(shm_peer.image(number))
        pool = sharing.session.shared_pool
        assert pool.placed > 0
        assert pool.placed + pool.refused == 20
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(slow)
        wait_until(lambda: executor.spin_once(0.01) is None or len(got) == 20)
        assert got == list(range(20))


@pytest.mark.integration
def test_subscribers_killed_while_they_hold_memory_give_it_back():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with metaros.Context(domain_id=0, connect=[], listen=endpoint, shared_memory="auto") as context:
        publisher, pool = shm_peer.publisher_of(context), context.session.shared_pool

        def all_there() -> bool:
            placed = [pool.place(bytes(shm_peer.IMAGE_BYTES)) for _ in range(6)]
            return not any(isinstance(item, bytes) for item in placed)

        for _ in range(_KILLS):
            with child("hold", endpoint) as holder:
                wait_until(lambda: publisher.events.matched)
                for number in range(4):
                    publisher.publish(shm_peer.image(number))
                assert [holder.stdout.readline() for _ in range(4)] == ["shared\n"] * 4
            wait_until(lambda: not publisher.events.matched)
            wait_until(all_there)


def ours() -> set[str]:
    """The files of the pools of this module's processes."""
    found = set()
    for name in os.listdir("/dev/shm"):
        with suppress(FileNotFoundError):
            if os.stat(f"/dev/shm/{name}").st_size == shm_peer.POOL_BYTES:
                found.add(name)
    return found


@pytest.mark.integration
def test_publishers_killed_in_full_flight_tear_no_message_and_leave_no_memory_behind():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    before = ours()  # of the tests in this very process, which has read from its own pools and keeps them
    with child("receive", endpoint) as receiver:
        assert receiver.stdout.readline() == "ready\n"
        for _ in range(_KILLS):
            with child("publish", endpoint):
                assert {receiver.stdout.readline() for _ in range(5)} == {"sound\n"}
        receiver.kill()
        assert "torn" not in receiver.stdout.read()
    with child("once", endpoint) as last:  # who opens shared memory next removes what the dead left
        assert last.stdout.readline() == "done\n"
        last.wait()
    wait_until(lambda: ours() <= before)
