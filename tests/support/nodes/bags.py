"""Recordings made without a network, and disks that fail."""

from __future__ import annotations

import errno
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from metaros.cdr import codec
from metaros.idl import schema_text
from metaros.record.bag_output import BagOptions, BagOutput
from metaros.record.ledger import Publisher
from metaros.record.sample_queue import Arrival, Route
from metaros.wire import QoSProfile

__all__ = ["START_NS", "SmallDisk", "arrivals", "route_for", "write_bag"]

START_NS = 1_700_000_000_000_000_000


class SmallDisk(io.FileIO):
    """A file that takes `room` bytes and no more, as on a full disk: a write may fit in part."""

    def __init__(self, path: Path, room: int) -> None:
        super().__init__(path, "x")
        self.room = room

    def write(self, data: Any) -> int:
        free = self.room - self.tell()
        if free <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(bytes(data)[:free])


def route_for(topic: str, message_type: type[Any], *, qos: QoSProfile | None = None) -> Route:
    """As the tap makes it of a known type."""
    code = codec(message_type)
    return Route(topic, code.name, code.hash, qos=[qos or QoSProfile()], schema=schema_text(code.name))


def arrivals(
    topic: str, messages: Sequence[Any], *, step_ns: int = 10_000_000, offset_ns: int = 0
) -> list[tuple[Arrival, bytes]]:
    """Messages of one publisher, numbered from 1, received every `step_ns` and sent a millisecond earlier."""
    route = route_for(topic, type(messages[0]))
    publisher = route.publishers.setdefault(b"g" * 16, Publisher(topic, route.type_name, b"g" * 16))
    encode = codec(type(messages[0])).encode
    made = []
    for number, message in enumerate(messages):
        log_ns = START_NS + offset_ns + number * step_ns
        made.append((Arrival(route, publisher, log_ns, log_ns - 1_000_000, number + 1, None), encode(message)))
    return made


def write_bag(path: Path, *streams: list[tuple[Arrival, bytes]], options: BagOptions | None = None) -> BagOutput:
    """A closed recording of those, in order of time."""
    output = BagOutput(path, options or BagOptions(chunk_bytes=2000))
    for arrival, payload in sorted((item for stream in streams for item in stream), key=lambda item: item[0].log_ns):
        output.write(arrival, payload)
    output.close()
    return output
