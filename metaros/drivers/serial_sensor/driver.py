"""Serial line sensor: a Float64 a field."""

from __future__ import annotations

from typing import Final

from metaros.drivers.lines import LineSplitter
from metaros.drivers.serial_port import SerialPort
from metaros.drivers.serial_sensor.fields import SKIPPED, field_names, line_reader
from metaros.drivers.unit import Device, Unit
from metaros.interfaces.std_msgs.msg import Float64

__all__ = ["SerialSensor", "make"]

MAX_LINE_BYTES: Final = 1024


class SerialSensor:
    """Reads lines and publishes the numbers in them. The first line of a port just opened is seldom whole: left out."""

    def __init__(self, unit: Unit) -> None:
        names = field_names(unit["fields"], columns=unit["format"] == "csv")
        self._unit = unit
        self._read = line_reader(unit["format"], names, unit["pattern"])
        self._publishers = {
            name: unit.publisher(Float64, f"{unit['topic']}/{name.replace('.', '/')}")
            for name in names
            if name != SKIPPED
        }
        self._port: SerialPort | None = None

    def open(self) -> None:
        """Open the port."""
        self._port = SerialPort(self._unit, self._unit["port"], self._unit["baud"])
        self._unit.opened(f"listening on {self._port.port}")

    def run(self) -> None:
        """Read and publish until the driver stops."""
        assert self._port is not None
        lines = LineSplitter(max_bytes=MAX_LINE_BYTES, count=self._unit.count)
        first = True
        while not self._unit.stopping:
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
            self._unit.count("bad_lines")
            return
        for name, publisher in self._publishers.items():
            if name in numbers:
                publisher.publish(Float64(data=numbers[name]))
            else:
                self._unit.count("missing_fields")


def make(unit: Unit) -> Device:
    """The driver's device; ConfigError: fields or a pattern that cannot be."""
    return SerialSensor(unit)
