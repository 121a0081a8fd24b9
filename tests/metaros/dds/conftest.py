"""A bridge between a router and a DDS domain, a node on one side, and a participant of DDS's own on the other."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

import metaros
from metaros.dds import DdsBridge, DdsOptions
from tests.support.servers.dds import dds_config, dds_domain
from tests.support.servers.routers import zenoh_router
from tests.support.waiting import wait_until

RELIABLE = Qos(Policy.Reliability.Reliable(100_000_000), Policy.History.KeepLast(10))
LATCHED = Qos(Policy.Durability.TransientLocal, base=RELIABLE)


class Rig:
    """One bridge, one node that spins, one participant; tests keep apart by names."""

    def __init__(self, router: str) -> None:
        self._domain = Domain(dds_domain(), dds_config())
        self.participant = DomainParticipant(dds_domain())
        self.context = metaros.Context(domain_id=0, connect=router, environ={})
        self.bridge = DdsBridge(self.context, DdsOptions(domain=dds_domain()))
        self.peers = metaros.Context(domain_id=0, connect=router, environ={})
        self.node = metaros.Node("peer", context=self.peers)
        self._executor = metaros.SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()

    def writer(self, topic: str, kind: type[Any], qos: Qos = RELIABLE) -> DataWriter[Any]:
        """Of a robot on DDS."""
        return DataWriter(self.participant, Topic(self.participant, topic, kind), qos=qos)

    def reader(self, topic: str, kind: type[Any], qos: Qos = RELIABLE) -> DataReader[Any]:
        """Of a robot on DDS."""
        return DataReader(self.participant, Topic(self.participant, topic, kind), qos=qos)

    def until(self, condition: Callable[[], object], *, send: Callable[[], object] = lambda: None) -> None:
        """Do `send()` again and again until `condition()`: what nobody listens to yet is lost."""

        def check() -> object:
            send()
            return condition()

        wait_until(check, every_s=0.02)

    def close(self) -> None:
        """End it all."""
        self._executor.shutdown()
        self._thread.join()
        self.bridge.close()
        self.peers.close()
        self.context.close()


@pytest.fixture(scope="module")
def rig() -> Iterator[Rig]:
    """The tests of a file share it."""
    with zenoh_router() as router:
        made = Rig(router)
        yield made
        made.close()
