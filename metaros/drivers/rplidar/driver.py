"""RPLIDAR: asks the device who and how it is, lets it scan, and publishes one LaserScan a turn."""

from __future__ import annotations

import contextlib
from collections import Counter
from typing import Final

from metaros.drivers.context import Device, DriverContext
from metaros.drivers.lidar_scans import Rays, Revolution, ScanAssembler, laser_scan
from metaros.drivers.rplidar.connection import RplidarConnection
from metaros.drivers.rplidar.samples import NodeStream, SampleStream
from metaros.drivers.serial_port import SerialPort
from metaros.errors import ConfigError, UnavailableError
from metaros.interfaces.sensor_msgs.msg import LaserScan

__all__ = ["RpLidar", "make"]

SILENT_S: Final = 3.0  # without a sound sample for so long: begin anew


class RpLidar:
    """One device on a serial port."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._publisher = context.publisher(LaserScan, context["topic"])
        self._port: SerialPort | None = None
        self._connection: RplidarConnection | None = None
        self._stream: SampleStream = NodeStream()
        self._turns = ScanAssembler()
        self._reported: Counter[str] = Counter()

    def open(self) -> None:
        """Say who and how it is, turn the motor on, begin to scan."""
        context = self._context
        self._port = SerialPort(context, context["port"], context["baud"])
        self._connection = connection = RplidarConnection(context, self._port)
        connection.stop_scan()
        info = connection.info()
        health = connection.check_health()
        connection.turn_motor(context["motor"], info)
        mode, self._stream = connection.scan(context["mode"], info)
        self._turns, self._reported = ScanAssembler(), Counter()
        firmware = f"{info.firmware[0]}.{info.firmware[1]:02}"
        context.fact("firmware", firmware)
        context.fact("hardware", info.hardware)
        context.fact("mode", mode)
        context.fact("health", health.word)
        context.opened(f"{info.name}, firmware {firmware}, {mode} scan", hardware_id=info.serial)
        context.warn("" if health.word == "good" else f"its health: {health.word} (code {health.code})")

    def run(self) -> None:
        """Read and publish until the driver stops."""
        assert self._port is not None
        assert self._connection is not None
        clock = self._context.clock
        self._add(self._connection.rest)
        sound_s = clock.monotonic_s()
        while not self._context.stopping:
            data = self._port.read()
            if data and self._add(data):
                sound_s = clock.monotonic_s()
            elif clock.monotonic_s() - sound_s > SILENT_S:
                raise UnavailableError(f"{self._port.port}: no sound sample for {SILENT_S:g} s")

    def close(self) -> None:
        """Stop scan and motor, and let the port go."""
        port, connection, self._port, self._connection = self._port, self._connection, None, None
        if port is None:
            return
        if connection is not None:
            with contextlib.suppress(UnavailableError):
                connection.rest_motor(self._context["motor"])
        port.close()

    def _add(self, data: bytes) -> bool:
        samples = self._stream.feed(data)
        self._report()
        if not samples:
            return False
        rays = Rays(
            angles_deg=[sample.angle_deg for sample in samples],
            ranges_m=[sample.distance_mm / 1000 for sample in samples],
            intensities=[sample.quality for sample in samples],
            stamp_ns=self._context.clock.wall_ns() - self._stream.delay_ns,
        )
        for turn in self._turns.add(rays):
            self._publish(turn)
        return True

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
        raise ConfigError("rplidar: range_min_m must be below range_max_m")
    return RpLidar(context)
