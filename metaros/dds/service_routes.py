"""One service: a server on DDS for callers in the ROS graph, or a server in the graph for callers on DDS.

Only Cyclone DDS's way is spoken: each request and reply begins with the caller's 8-byte id and a sequence number
(rmw_cyclonedds_cpp's `cdds_request_header_t`). Fast DDS puts them beside the payload, where its Python has no access.
"""

from __future__ import annotations

import struct
import uuid
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Final

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from metaros.dds.names import Kind, dds_topic
from metaros.dds.qos import reader_qos, writer_qos
from metaros.dds.report import Direction, RouteRow
from metaros.dds.types import make_sample, message_type, with_header
from metaros.errors import MetarosError
from metaros.idl import Catalogue, message_class, type_hash
from metaros.limits import LIMITS
from metaros.node import Node
from metaros.node.service import PendingRequest, Responder
from metaros.wire import QoSProfile, qos_services

__all__ = ["ServedByDds", "ServedByRos"]

_HEADER: Final = struct.Struct("<Qq")
_BODY: Final = 4 + _HEADER.size
_SLICE: Final = 64
_QOS: Final = QoSProfile(depth=100)


@dataclass(frozen=True)
class _Raw:
    """What a `Responder` needs of a codec where nobody reads the bytes."""

    decode: Callable[[Any], Any] = bytes
    encode: Callable[[Any], bytes] = bytes


class _ServiceRoute:
    """The DDS ends of a service, and what was counted. `outward` is the half that this bridge writes."""

    direction: Direction

    def __init__(
        self, participant: DomainParticipant, name: str, type_name: str, catalogue: Catalogue, *, outward: Kind
    ) -> None:
        self.name, self.type_name = name, type_name
        self.answered = self.bytes = self.dropped = self.failed = 0
        inward = Kind.REPLY if outward is Kind.REQUEST else Kind.REQUEST
        types = {kind: message_type(_half(type_name, kind), catalogue, header=True) for kind in (outward, inward)}
        topics: dict[Kind, Any] = {kind: Topic(participant, dds_topic(kind, name), types[kind]) for kind in types}
        told = _identity("client" if outward is Kind.REQUEST else "service", type_hash(type_name, catalogue))
        self._outward = types[outward]
        self._writer: DataWriter[Any] = DataWriter(participant, topics[outward], qos=_with(writer_qos(_QOS), told))
        self.reader: DataReader[Any] = DataReader(participant, topics[inward], qos=_with(reader_qos(_QOS), told))

    def row(self) -> RouteRow:
        """For the report."""
        return RouteRow(
            name=self.name,
            direction=self.direction,
            type=self.type_name,
            bridged=self.answered,
            bytes=self.bytes,
            dropped=self.dropped,
            failed=self.failed,
        )

    def work(self) -> bool:
        """Handle what has come; whether more may be there."""
        samples: list[Any] = self.reader.take(_SLICE)
        for sample in samples:
            cdr = getattr(sample, "cdr", None)
            if cdr is None:
                continue
            if len(cdr) < _BODY:
                self.failed += 1
                continue
            caller, number = _HEADER.unpack_from(cdr, 4)
            self.take(caller, number, cdr[:4] + cdr[_BODY:])
        return len(samples) == _SLICE

    def take(self, caller: int, number: int, cdr: bytes) -> None:
        """A request or a reply of DDS."""
        raise NotImplementedError

    def write(self, caller: int, number: int, cdr: bytes) -> None:
        """The other one, to DDS."""
        self._writer.write(make_sample(self._outward, with_header(cdr, _HEADER.pack(caller, number))))
        self.bytes += len(cdr)


class ServedByDds(_ServiceRoute):
    """Offers in the ROS graph a service whose server is on DDS."""

    direction = Direction.SERVED_BY_DDS

    def __init__(
        self, node: Node, participant: DomainParticipant, *, name: str, type_name: str, catalogue: Catalogue
    ) -> None:
        super().__init__(participant, name, type_name, catalogue, outward=Kind.REQUEST)
        self._id = uuid.uuid4().int & (2**63 - 1)
        self._calls = 0
        self._waiting: OrderedDict[int, PendingRequest] = OrderedDict()
        raw: Any = _Raw()
        service = message_class(type_name, catalogue)
        self._responder = Responder(node, service, name, self._ask, request=raw, response=raw, qos=qos_services)

    def _ask(self, request: bytes, waiting: PendingRequest) -> None:
        """On the node's executor."""
        self._calls += 1
        number = self._calls
        self._waiting[number] = waiting
        while len(self._waiting) > LIMITS.dds_calls:
            _, oldest = self._waiting.popitem(last=False)
            oldest.refuse("unavailable: too many calls wait for the service on DDS")
            self.dropped += 1
        self.write(self._id, number, request)

    def take(self, caller: int, number: int, cdr: bytes) -> None:
        """A reply; those to others are theirs."""
        waiting = self._waiting.pop(number, None) if caller == self._id else None
        if waiting is not None:
            waiting.answer(cdr)
            self.answered += 1
            self.bytes += len(cdr)

    def close(self) -> None:
        """Leave the graph; who waits is told."""
        self._responder.close()


class ServedByRos(_ServiceRoute):
    """Offers on DDS a service whose server is in the ROS graph."""

    direction = Direction.SERVED_BY_ROS

    def __init__(
        self, node: Node, participant: DomainParticipant, *, name: str, type_name: str, catalogue: Catalogue
    ) -> None:
        super().__init__(participant, name, type_name, catalogue, outward=Kind.REPLY)
        self._client = node.create_raw_client(name, type_name, type_hash(type_name, catalogue))
        self._open = 0

    def take(self, caller: int, number: int, cdr: bytes) -> None:
        """A request: call, and write the answer when it comes. DDS has no word for a refusal: its caller waits on."""
        if self._open >= LIMITS.dds_calls:
            self.dropped += 1
            return
        try:
            future = self._client.call_future(cdr)
        except MetarosError:
            self.failed += 1
            raise
        self._open += 1
        future.add_done_callback(lambda done: self._answer(caller, number, done))

    def _answer(self, caller: int, number: int, done: Future[Any]) -> None:
        """On a thread of the client."""
        self._open -= 1
        if done.cancelled() or done.exception() is not None:
            self.failed += 1
            return
        self.write(caller, number, done.result())
        self.answered += 1

    def close(self) -> None:
        """Leave the graph."""
        self._client.close()


def _half(type_name: str, kind: Kind) -> str:
    return f"{type_name}_{'Request' if kind is Kind.REQUEST else 'Response'}"


def _identity(role: str, hash_text: str) -> bytes:
    """What rmw_cyclonedds_cpp writes to both ends of a client or server, by which the other side pairs them."""
    own = ".".join(f"{byte:x}" for byte in uuid.uuid4().bytes)
    return f"{role}id={own};typehash={hash_text};".encode()


def _with(qos: Qos, told: bytes) -> Qos:
    return Qos(Policy.Userdata(told), base=qos)
