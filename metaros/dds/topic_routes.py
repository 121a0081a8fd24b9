"""One topic in one direction: a DDS reader with a publisher of ours, or a subscription of ours with a DDS writer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import zenoh
from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from metaros.concurrency.backlog import Backlog
from metaros.dds.names import Kind, dds_topic
from metaros.dds.qos import reader_qos, writer_qos
from metaros.dds.report import Direction, RouteRow
from metaros.dds.types import make_sample, message_type
from metaros.errors import MetarosError
from metaros.idl import Catalogue, type_hash
from metaros.node import Node
from metaros.wire import QoSProfile, parse_attachment

__all__ = ["FromDds", "ToDds"]

_SLICE: Final = 64  # samples of a topic before the others have their turn
_OVERHEAD_BYTES: Final = 512


class _Route:
    """What both directions count."""

    direction: Direction

    def __init__(self, name: str, type_name: str, qos: QoSProfile) -> None:
        self.name, self.type_name, self.qos = name, type_name, qos
        self.bridged = self.bytes = self.failed = self.dropped = 0

    def row(self) -> RouteRow:
        """For the report."""
        return RouteRow(
            name=self.name,
            direction=self.direction,
            type=self.type_name,
            bridged=self.bridged,
            bytes=self.bytes,
            dropped=self.dropped,
            failed=self.failed,
        )


class FromDds(_Route):
    """Publishes in the ROS graph what DDS writers of others write."""

    direction = Direction.TO_ROS

    def __init__(
        self,
        node: Node,
        participant: DomainParticipant,
        *,
        name: str,
        type_name: str,
        catalogue: Catalogue,
        qos: QoSProfile,
    ) -> None:
        super().__init__(name, type_name, qos)
        topic: Any = Topic(participant, dds_topic(Kind.TOPIC, name), message_type(type_name, catalogue))
        self._publisher = node.create_raw_publisher(name, type_name, type_hash(type_name, catalogue), qos)
        self.reader = DataReader(participant, topic, qos=reader_qos(qos))

    @property
    def gid(self) -> bytes:
        """Whose samples must not go back."""
        return self._publisher.gid

    def work(self) -> bool:
        """Publish what has come, up to a slice of it; whether more may be there."""
        samples: list[Any] = self.reader.take(_SLICE)
        for sample in samples:
            cdr = getattr(sample, "cdr", None)
            if cdr is None:  # a writer went
                continue
            try:
                self._publisher.publish(cdr, stamp_ns=sample.sample_info.source_timestamp)
            except MetarosError:
                self.failed += 1
                raise
            self.bridged += 1
            self.bytes += len(cdr)
        return len(samples) == _SLICE

    def close(self) -> None:
        """Leave both sides; the reader goes with its last reference."""
        self._publisher.close()


class ToDds(_Route):
    """Writes to DDS what publishers in the ROS graph publish, the bridge's own left out."""

    direction = Direction.TO_DDS

    def __init__(
        self,
        node: Node,
        participant: DomainParticipant,
        *,
        name: str,
        type_name: str,
        catalogue: Catalogue,
        qos: QoSProfile,
        dds_qos: QoSProfile,
        is_own: Callable[[bytes], bool],
        wake: Callable[[], None],
    ) -> None:
        super().__init__(name, type_name, qos)
        self.dds_qos = dds_qos
        self._type = message_type(type_name, catalogue)
        self._is_own = is_own
        self._wake = wake
        self._backlog: Backlog[zenoh.Sample] = Backlog()
        hash_text = type_hash(type_name, catalogue)
        topic: Any = Topic(participant, dds_topic(Kind.TOPIC, name), self._type)
        self._writer: DataWriter[Any] = DataWriter(participant, topic, qos=writer_qos(dds_qos, type_hash=hash_text))
        self._subscription = node.create_raw_subscription(name, type_name, hash_text, qos, self._sink)

    def _sink(self, sample: zenoh.Sample) -> None:
        """On a Zenoh thread, or on the bridge's own: never on the main thread, where a signal could be lost here."""
        self._backlog.put(sample, len(sample.payload) + _OVERHEAD_BYTES)
        self._wake()

    def work(self) -> bool:
        """Write what waits, up to a slice of it; whether more is there."""
        for _ in range(_SLICE):
            sample = self._backlog.take()
            if sample is None:
                break
            self._write(sample)
        self.dropped = self._backlog.dropped
        return len(self._backlog) > 0

    def _write(self, sample: zenoh.Sample) -> None:
        if sample.attachment is None:
            self.failed += 1
            return
        try:
            _, stamp_ns, gid = parse_attachment(sample.attachment.to_bytes())
            if self._is_own(gid):
                return
            cdr = sample.payload.to_bytes()
            self._writer.write(make_sample(self._type, cdr), stamp_ns)
        except (MetarosError, DDSException):
            self.failed += 1
            raise
        self.bridged += 1
        self.bytes += len(cdr)

    def close(self) -> None:
        """Leave both sides; the writer goes with its last reference."""
        self._subscription.close()
        self._backlog.clear()
