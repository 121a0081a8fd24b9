"""Serial line sensor: a Float64 a field."""

from __future__ import annotations

from typing import Final

from metaros.drivers.context import Device, DriverContext
from metaros.drivers.lines import LineSplitter
from metaros.drivers.serial_port import SerialPort
from metaros.drivers.serial_sensor.fields import SKIPPED, field_names, line_reader
from metaros.interfaces.std_msgs.msg import Float64

__all__ = ["SerialSensor", "make"]

MAX_LINE_BYTES: Final = 1024


class SerialSensor:
    """Reads lines and publishes the numbers in them. The first line of a port just opened is seldom whole: left out."""

    def __init__(self, context: DriverContext) -> None:
        names = field_names(context["fields"], columns=context["format"] == "csv")
        self._context = context
        self._read = line_reader(context["format"], names, context["pattern"])
        self._publishers = {
            name: context.publisher(Float64, f"{context['topic']}/{name.replace('.', '/')}")
            for name in names
            if name != SKIPPED
        }
        self._port: SerialPort | None = None

    def open(self) -> None:
        """Open the port."""
        self._port = SerialPort(self._context, self._context["port"], self._context["baud"])
        self._context.opened(f"listening on {self._port.port}")

    def run(self) -> None:
        """Read and publish until the driver stops."""
        assert self._port is not None
        lines = LineSplitter(max_bytes=MAX_LINE_BYTES, count=self._context.count)
        first = True
        while not self._context.stopping:
            for line in lines.feed(self._port.read()):
                if not first:
                    self._publish(line)
                first = False

    def close(self) -> None:
        """Let the port go."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _publish(self, line: str) -> None:
        try:
            numbers = self._read(line)
        except ValueError:
            self._context.count("bad_lines")
            return
        for name, publisher in self._publishers.items():
            if name in numbers:
                publisher.publish(Float64(data=numbers[name]))
            else:
                self._context.count("missing_fields")


def make(context: DriverContext) -> Device:
    """The driver's device; ConfigError: fields or a pattern that cannot be."""
    return SerialSensor(context)
