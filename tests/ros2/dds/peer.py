"""A robot on DDS: a participant of Cyclone DDS, which knows nothing of Zenoh, behind the bridge of `metaros dds`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from itertools import count
from typing import Any, get_type_hints

from cyclonedds.core import Listener, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

import metaros
from metaros.dds import DdsBridge, DdsOptions
from tests.ros2.dds.types import TYPES, AddRequest, AddResponse
from tests.ros2.participant import Fields, Seen
from tests.support.servers.dds import dds_config, dds_domain
from tests.support.waiting import wait_until

__all__ = ["DdsPeer"]

RELIABLE = Qos(Policy.Reliability.Reliable(100_000_000), Policy.History.KeepLast(10))
LATCHED = Qos(Policy.Durability.TransientLocal, base=RELIABLE)
DOMAIN = (dds_domain() + 35) % 90 + 10  # not that of the bridge's own tests in this process


class DdsPeer:
    """Its names are those of rmw_cyclonedds_cpp: `rt/…`, `rq/…Request`, `rr/…Reply`."""

    def __init__(self, router: str, name: str = "dds") -> None:
        self.name = name
        self._domain = Domain(DOMAIN, dds_config())
        self._context = metaros.Context(domain_id=0, connect=router, environ={})
        self._bridge = DdsBridge(self._context, DdsOptions(domain=DOMAIN))
        self._participant = DomainParticipant(DOMAIN)
        self._made: list[Any] = []
        self._seq = count(1)
        self._clients: dict[str, tuple[Any, Any]] = {}
        replies = self._writer(f"rr/{name}/addReply", AddResponse)

        class Answering(Listener):  # type: ignore[misc]
            """Runs on a thread of DDS."""

            def on_data_available(self, reader: Any) -> None:
                for one in _valid(reader, AddRequest):
                    replies.write(AddResponse(one.client_guid, one.sequence_number, one.a + one.b))

        topic = Topic(self._participant, f"rq/{name}/addRequest", AddRequest)
        self._server = (replies, DataReader(self._participant, topic, qos=RELIABLE, listener=Answering()))

    def _writer(self, topic: str, kind: Any, qos: Qos = RELIABLE) -> Any:
        return DataWriter(self._participant, Topic(self._participant, topic, kind), qos=qos)

    def _reader(self, topic: str, kind: Any, qos: Qos = RELIABLE) -> Any:
        return DataReader(self._participant, Topic(self._participant, topic, kind), qos=qos)

    @contextmanager
    def lending(self) -> Iterator[None]:
        """See `Participant`."""
        yield
        self._made.clear()
        self._clients.clear()

    def speak(self, topic: str, type_name: str, fields: Fields, *, latched: bool = False) -> Callable[[], object]:
        """See `Participant`."""
        writer = self._writer(f"rt{topic}", TYPES[type_name], LATCHED if latched else RELIABLE)
        self._made.append(writer)
        message = _build(TYPES[type_name], fields)
        return lambda: writer.write(message)

    def listen(self, topic: str, type_name: str, *, latched: bool = False) -> Callable[[], list[Fields]]:
        """See `Participant`."""
        reader = self._reader(f"rt{topic}", TYPES[type_name], LATCHED if latched else RELIABLE)
        self._made.append(reader)
        heard: list[Fields] = []

        def drain() -> list[Fields]:
            heard.extend(asdict(message) for message in _valid(reader, TYPES[type_name]))
            return heard

        return drain

    def add(self, server: str, a: int, b: int) -> int:
        """As rmw_cyclonedds_cpp asks: who asks, and a number, stand before the request."""
        if server not in self._clients:
            requests = self._writer(f"rq/{server}/addRequest", AddRequest)
            self._clients[server] = requests, self._reader(f"rr/{server}/addReply", AddResponse)
            wait_until(lambda: requests.get_matched_subscriptions())
        requests, replies = self._clients[server]
        seq, came = next(self._seq), list[Any]()
        requests.write(AddRequest(7, seq, a, b))
        wait_until(
            lambda: came.extend(one for one in _valid(replies, AddResponse) if one.sequence_number == seq) or came
        )
        return int(came[0].sum)

    def endpoints(self, topic: str) -> list[Seen]:
        """Those on Zenoh are no endpoints of DDS."""
        raise NotImplementedError(topic)

    def close(self) -> None:
        """See `Participant`."""
        self._bridge.close()
        self._context.close()


def _valid(reader: Any, kind: Any) -> list[Any]:
    """Samples, without the notes that a writer has gone."""
    return [one for one in reader.take(100) if isinstance(one, kind)]


def _build(kind: Any, fields: Fields) -> Any:
    hints = get_type_hints(kind)
    return kind(
        **{name: _build(hints[name], value) if isinstance(value, dict) else value for name, value in fields.items()}
    )
