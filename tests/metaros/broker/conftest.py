"""A broker on free ports, a node beside it in another session, and bare ZeroMQ programs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import zmq

import metaros
from metaros.broker import Broker, BrokerOptions, HubOptions
from tests.support.ports import free_port
from tests.support.waiting import wait_until


class Rig:
    """One broker, one node that spins, any number of ZeroMQ sockets."""

    def __init__(self, router: str, **options: Any) -> None:
        self.router = router
        self.hub = HubOptions(xsub=(f"tcp://127.0.0.1:{free_port()}",), xpub=(f"tcp://127.0.0.1:{free_port()}",))
        self.zmq = zmq.Context()
        self._sockets: list[zmq.Socket[bytes]] = []
        self.context = metaros.Context(domain_id=0, connect=router)
        self.broker = Broker(self.context, BrokerOptions(hub=self.hub, **options))
        self.peers = metaros.Context(domain_id=0, connect=router)
        self.node = metaros.Node("peer", context=self.peers)
        self._executor = metaros.SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()

    def publisher(self) -> zmq.Socket[bytes]:
        """As the publisher of `metaros` 1.x has it."""
        socket = self._socket(zmq.PUB)
        socket.connect(self.hub.xsub[0])
        return socket

    def subscriber(self, *prefixes: bytes) -> zmq.Socket[bytes]:
        """As the subscriber of `metaros` 1.x has it."""
        socket = self._socket(zmq.SUB)
        for prefix in prefixes:
            socket.subscribe(prefix)
        socket.connect(self.hub.xpub[0])
        return socket

    def _socket(self, kind: int) -> zmq.Socket[bytes]:
        socket = self.zmq.socket(kind)
        socket.linger = 0
        self._sockets.append(socket)  # one that is collected before it is closed is a warning
        return socket

    def until(self, condition: Callable[[], object], *, send: Callable[[], object] = lambda: None) -> None:
        """Do `send()` again and again until `condition()`: ZeroMQ and Zenoh lose what nobody listens to yet."""

        def check() -> object:
            send()
            return condition()

        wait_until(check, every_s=0.02)

    def row(self, topic: str, direction: str) -> Any:
        """A row of the report; None where there is none."""
        rows = [row for row in self.broker.report().rows if (row.topic, row.direction.name) == (topic, direction)]
        return rows[0] if rows else None

    def close(self) -> None:
        """Everything, in an order that loses nothing."""
        self._executor.shutdown()
        self._thread.join()
        for socket in self._sockets:
            socket.close()
        self.zmq.term()
        self.node.close()
        self.broker.close()
        self.peers.close()
        self.context.close()


@pytest.fixture
def make_rig(zenoh_router: str) -> Iterator[Callable[..., Rig]]:
    """`make_rig(strict_json=True)`: a rig whose broker has these options."""
    rigs: list[Rig] = []

    def make(**options: Any) -> Rig:
        rigs.append(Rig(zenoh_router, **options))
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.close()


@pytest.fixture
def rig(make_rig: Callable[..., Rig]) -> Rig:
    """A rig with the default options."""
    return make_rig()


def received(socket: zmq.Socket[bytes]) -> list[list[bytes]]:
    """What has arrived by now."""
    found = []
    while socket.poll(0):
        found.append(socket.recv_multipart())
    return found
