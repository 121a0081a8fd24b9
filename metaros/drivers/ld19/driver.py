"""LD06 / LD19: one LaserScan a turn."""

from __future__ import annotations

from collections import Counter
from typing import Final

from metaros.drivers.ld19.protocol import BAUD, CLOCK_MS, PACKET_BYTES, Packet, PacketStream
from metaros.drivers.serial_port import SerialPort
from metaros.drivers.turns import Rays, Turn, TurnAssembler, laser_scan
from metaros.drivers.unit import Device, Unit
from metaros.errors import ConfigError
from metaros.interfaces.sensor_msgs.msg import LaserScan

__all__ = ["Ld19", "make"]

TRANSFER_NS: Final = PACKET_BYTES * 10 * 1_000_000_000 // BAUD  # a packet is that old when its last byte is here
LEAP_MS: Final = 100  # packets follow each other by 2.7 ms; a longer step is a part of a turn that is lost


class Ld19:
    """Reads packets, which come by themselves, and publishes whole turns."""

    def __init__(self, unit: Unit) -> None:
        self._unit = unit
        self._publisher = unit.publisher(LaserScan, unit["topic"])
        self._port: SerialPort | None = None
        self._stream = PacketStream()
        self._turns = TurnAssembler()
        self._told: Counter[str] = Counter()
        self._clock_ms = -1

    def open(self) -> None:
        """Open the port; the device talks once it turns."""
        self._port = SerialPort(self._unit, self._unit["port"], BAUD)
        self._stream, self._turns, self._told, self._clock_ms = PacketStream(), TurnAssembler(), Counter(), -1
        self._unit.opened(f"listening on {self._port.port}")

    def run(self) -> None:
        """Read and publish until the driver stops."""
        assert self._port is not None
        while not self._unit.stopping:
            data = self._port.read()
            if not data:
                continue
            now_ns = self._unit.clock.wall_ns() - TRANSFER_NS
            packets = self._stream.feed(data)
            for packet in packets:  # several that came at once are as far apart as the device's clock says
                age_ms = (packets[-1].clock_ms - packet.clock_ms) % CLOCK_MS
                self._add(packet, now_ns - age_ms * 1_000_000)
            self._tell()

    def close(self) -> None:
        """Let the port go."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _add(self, packet: Packet, stamp_ns: int) -> None:
        step_ms = (packet.clock_ms - self._clock_ms) % CLOCK_MS
        if self._clock_ms >= 0 and step_ms > LEAP_MS:
            self._unit.count("gaps")
            self._turns.restart()
        self._clock_ms = packet.clock_ms
        rays = Rays(
            angles_deg=packet.angles_deg,
            ranges_m=[distance / 1000 for distance in packet.distances_mm],
            intensities=packet.intensities,
            stamp_ns=stamp_ns,
        )
        for turn in self._turns.add(rays):
            self._publish(turn)
            self._unit.fact("speed_hz", f"{packet.speed_deg_s / 360:.2f}")

    def _publish(self, turn: Turn) -> None:
        unit = self._unit
        scan = laser_scan(
            turn,
            bins=unit["bins"],
            range_min_m=unit["range_min_m"],
            range_max_m=unit["range_max_m"],
            frame_id=unit["frame_id"],
        )
        self._publisher.publish(scan, stamp_ns=turn.ended_ns)

    def _tell(self) -> None:
        found = self._stream.counters + Counter(short_turns=self._turns.short_turns)
        for name, by in (found - self._told).items():
            self._unit.count(name, by)
        self._told = found


def make(unit: Unit) -> Device:
    """The driver's device; ConfigError: ranges that exclude each other."""
    if unit["range_min_m"] >= unit["range_max_m"]:
        raise ConfigError("ld19: range_min_m must be below range_max_m")
    return Ld19(unit)
