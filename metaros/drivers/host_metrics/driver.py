"""Host metrics: what the reader finds, as messages. It is no device, so it is never away."""

from __future__ import annotations

from metaros.drivers.context import Device, DriverContext
from metaros.drivers.host_metrics.reader import HOST_TOPICS, HostReader, read_all
from metaros.errors import UnavailableError
from metaros.idl import message_class
from metaros.wire import qos_default

__all__ = ["HostMetrics", "make"]


class HostMetrics:
    """Reads and publishes at `rate_hz`; what this machine does not let us read is left out, and said once."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._reader: HostReader | None = None
        self._unreadable: set[str] = set()
        self._publishers = {
            item.topic: context.publisher(
                message_class(item.type_name), f"{context['topic']}/{item.topic.removeprefix('host/')}", qos_default
            )
            for item in HOST_TOPICS
        }

    def open(self) -> None:
        """Begin to count."""
        self._reader = HostReader(self._context.clock, disk_path=self._context["disk_path"])
        self._context.opened("reading this host")

    def run(self) -> None:
        """Read and publish until the driver stops."""
        assert self._reader is not None
        while not self._context.wait(1 / self._context["rate_hz"]):
            readings = read_all(self._reader, HOST_TOPICS, self._unreadable)
            if not readings:
                raise UnavailableError("nothing of this host can be read")
            for item, fields in readings:
                message = message_class(item.type_name)(stamp=self._context.stamp(), **fields)
                self._publishers[item.topic].publish(message)
            self._context.warn(f"not readable: {', '.join(sorted(self._unreadable))}" if self._unreadable else "")

    def close(self) -> None:
        """There is nothing to let go."""


def make(context: DriverContext) -> Device:
    """The driver's device."""
    return HostMetrics(context)
