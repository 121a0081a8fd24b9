"""RPLIDAR: asks the device who and how it is, lets it scan, and publishes one LaserScan a turn."""

from __future__ import annotations

import contextlib
from collections import Counter
from typing import Final

from metaros.drivers.rplidar.conversation import Conversation
from metaros.drivers.rplidar.samples import NodeStream, SampleStream
from metaros.drivers.serial_port import SerialPort
from metaros.drivers.turns import Rays, Turn, TurnAssembler, laser_scan
from metaros.drivers.unit import Device, Unit
from metaros.errors import ConfigError, UnavailableError
from metaros.interfaces.sensor_msgs.msg import LaserScan

__all__ = ["RpLidar", "make"]

SILENT_S: Final = 3.0  # without a sound sample for so long: begin anew


class RpLidar:
    """One device on a serial port."""

    def __init__(self, unit: Unit) -> None:
        self._unit = unit
        self._publisher = unit.publisher(LaserScan, unit["topic"])
        self._port: SerialPort | None = None
        self._talk: Conversation | None = None
        self._stream: SampleStream = NodeStream()
        self._turns = TurnAssembler()
        self._told: Counter[str] = Counter()

    def open(self) -> None:
        """Say who and how it is, turn the motor on, begin to scan."""
        unit = self._unit
        self._port = SerialPort(unit, unit["port"], unit["baud"])
        self._talk = talk = Conversation(unit, self._port)
        talk.hush()
        info = talk.info()
        health = talk.check_health()
        talk.turn_motor(unit["motor"], info)
        mode, self._stream = talk.scan(unit["mode"], info)
        self._turns, self._told = TurnAssembler(), Counter()
        firmware = f"{info.firmware[0]}.{info.firmware[1]:02}"
        unit.fact("firmware", firmware)
        unit.fact("hardware", info.hardware)
        unit.fact("mode", mode)
        unit.fact("health", health.word)
        unit.opened(f"{info.name}, firmware {firmware}, {mode} scan", hardware_id=info.serial)
        unit.warn("" if health.word == "good" else f"its health: {health.word} (code {health.code})")

    def run(self) -> None:
        """Read and publish until the driver stops."""
        assert self._port is not None
        assert self._talk is not None
        clock = self._unit.clock
        self._add(self._talk.rest)
        sound_s = clock.monotonic_s()
        while not self._unit.stopping:
            data = self._port.read()
            if data and self._add(data):
                sound_s = clock.monotonic_s()
            elif clock.monotonic_s() - sound_s > SILENT_S:
                raise UnavailableError(f"{self._port.port}: no sound sample for {SILENT_S:g} s")

    def close(self) -> None:
        """Stop scan and motor, and let the port go."""
        port, talk, self._port, self._talk = self._port, self._talk, None, None
        if port is None:
            return
        if talk is not None:
            with contextlib.suppress(UnavailableError):
                talk.rest_motor(self._unit["motor"])
        port.close()

    def _add(self, data: bytes) -> bool:
        samples = self._stream.feed(data)
        self._tell()
        if not samples:
            return False
        rays = Rays(
            angles_deg=[sample.angle_deg for sample in samples],
            ranges_m=[sample.distance_mm / 1000 for sample in samples],
            intensities=[sample.quality for sample in samples],
            stamp_ns=self._unit.clock.wall_ns() - self._stream.delay_ns,
        )
        for turn in self._turns.add(rays):
            self._publish(turn)
        return True

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
        raise ConfigError("rplidar: range_min_m must be below range_max_m")
    return RpLidar(unit)
