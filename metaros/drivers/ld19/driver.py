"""LD06 / LD19: one LaserScan a turn."""

from __future__ import annotations

from collections import Counter
from typing import Final

from metaros.drivers.context import Device, DriverContext
from metaros.drivers.ld19.protocol import BAUD, CLOCK_MS, PACKET_BYTES, Packet, PacketStream
from metaros.drivers.lidar_scans import Rays, Revolution, ScanAssembler, laser_scan
from metaros.drivers.serial_port import SerialPort
from metaros.errors import ConfigError
from metaros.interfaces.sensor_msgs.msg import LaserScan

__all__ = ["Ld19", "make"]

TRANSFER_NS: Final = PACKET_BYTES * 10 * 1_000_000_000 // BAUD  # a packet is that old when its last byte is here
LEAP_MS: Final = 100  # packets follow each other by 2.7 ms; a longer step is a part of a turn that is lost


class Ld19:
    """Reads packets, which come by themselves, and publishes whole turns."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._publisher = context.publisher(LaserScan, context["topic"])
        self._port: SerialPort | None = None
        self._stream = PacketStream()
        self._turns = ScanAssembler()
        self._reported: Counter[str] = Counter()
        self._clock_ms = -1

    def open(self) -> None:
        """Open the port; the device talks once it turns."""
        self._port = SerialPort(self._context, self._context["port"], BAUD)
        self._stream, self._turns, self._reported, self._clock_ms = PacketStream(), ScanAssembler(), Counter(), -1
        self._context.opened(f"listening on {self._port.port}")

    def run(self) -> None:
        """Read and publish until the driver stops."""
        assert self._port is not None
        while not self._context.stopping:
            data = self._port.read()
            if not data:
                continue
            now_ns = self._context.clock.wall_ns() - TRANSFER_NS
            packets = self._stream.feed(data)
            for packet in packets:  # several that came at once are as far apart as the device's clock says
                age_ms = (packets[-1].clock_ms - packet.clock_ms) % CLOCK_MS
                self._add(packet, now_ns - age_ms * 1_000_000)
            self._report()

    def close(self) -> None:
        """Let the port go."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _add(self, packet: Packet, stamp_ns: int) -> None:
        step_ms = (packet.clock_ms - self._clock_ms) % CLOCK_MS
        if self._clock_ms >= 0 and step_ms > LEAP_MS:
            self._context.count("gaps")
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
            self._context.fact("speed_hz", f"{packet.speed_deg_s / 360:.2f}")

    def _publish(self, turn: Revolution) -> None:
        context = self._context
        scan = laser_scan(
            turn,
            bins=context["bins"],
            range_min_m=context["range_min_m"],
            range_max_m=context["range_max_m"],
            frame_id=context["frame_id"],
        )
        self._publisher.publish(scan, stamp_ns=turn.ended_ns)

    def _report(self) -> None:
        found = self._stream.counters + Counter(short_turns=self._turns.short_turns)
        for name, by in (found - self._reported).items():
            self._context.count(name, by)
        self._reported = found


def make(context: DriverContext) -> Device:
    """The driver's device; ConfigError: ranges that exclude each other."""
    if context["range_min_m"] >= context["range_max_m"]:
        raise ConfigError("ld19: range_min_m must be below range_max_m")
    return Ld19(context)
