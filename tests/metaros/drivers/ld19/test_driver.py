"""The LD19 driver on a pty: the room it sees, through garbage, gaps and unplugging."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import metaros
from metaros.errors import ConfigError
from metaros.interfaces.sensor_msgs.msg import LaserScan
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.ld19_emulator import Ld19Emulator
from tests.support.devices.pty_device import PtyDevice
from tests.support.devices.room import AHEAD_M, BEHIND_M, LEFT_M, RIGHT_M
from tests.support.devices.serial_peer import answering
from tests.support.waiting import wait_until


@pytest.fixture
def device(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(tmp_path) as made:
        yield made


def nothing(_: bytes) -> None:
    """It hears nothing: LD19s only talk."""


def assert_room(scan: LaserScan) -> None:
    """Its walls are where they are."""
    at = {degrees: float(scan.ranges[round((degrees + 180) / 360 * len(scan.ranges))]) for degrees in (-90, 0, 90)}
    assert at == pytest.approx({-90: RIGHT_M, 0: AHEAD_M, 90: LEFT_M}, abs=0.02)
    assert scan.ranges[1] == pytest.approx(BEHIND_M, abs=0.02)


def together(scans: list[LaserScan]) -> LaserScan:
    """What most of them say."""
    ranges = np.ma.masked_invalid(np.stack([np.array(scan.ranges) for scan in scans]))
    return LaserScan(ranges=np.ma.median(ranges, axis=0).filled(np.nan).astype(np.float32))


def seen(driver: RunningDriver, scans: list[LaserScan], more: int = 2) -> LaserScan:
    """The newest scan once so many more have come."""
    goal = len(scans) + more
    wait_until(lambda: len(scans) >= goal)
    return scans[-1]


def test_scans_of_a_room(device: PtyDevice, context: metaros.Context) -> None:
    lidar = Ld19Emulator()
    with running("ld19", {"port": device.path, "frame_id": "nose"}, context=context) as driver:
        scans = driver.messages(LaserScan, "scan")
        with answering(device, nothing, lambda: lidar.turns(0.25)):
            scan = seen(driver, scans)
            wait_until(lambda: driver.state() == "working" and "speed_hz" in driver.facts())
        assert_room(scan)
        assert scan.header.frame_id == "nose"
        assert len(scan.ranges) == 450
        assert scan.angle_increment == pytest.approx(2 * math.pi / 450)
        assert np.isfinite(scan.ranges).mean() > 0.95
        assert driver.facts()["speed_hz"] == "10.00"


def test_through_garbage_before_between_and_within(device: PtyDevice, context: metaros.Context) -> None:
    lidar, noise = Ld19Emulator(), np.random.default_rng(6)

    def dirty() -> bytes:
        packets = [lidar.packet() for _ in range(40)]
        torn = bytearray(packets[7])
        torn[20] ^= 0x55
        packets[7] = bytes(torn)
        packets[20] = packets[20][:30]
        return noise.integers(0, 256, 500, dtype=np.uint8).tobytes() + b"".join(packets)

    with running("ld19", {"port": device.path}, context=context) as driver:
        scans = driver.messages(LaserScan, "scan")
        with answering(device, nothing, dirty):
            seen(driver, scans, 8)
            assert_room(together(scans))  # of each one garbage takes a sector away
            wait_until(lambda: int(driver.facts().get("bad_crc", 0)) > 2)
            wait_until(lambda: int(driver.facts().get("skipped_bytes", 0)) > 500)


def test_much_noise_then_a_room(device: PtyDevice, context: metaros.Context) -> None:
    lidar = Ld19Emulator()
    with running("ld19", {"port": device.path}, context=context) as driver:
        scans = driver.messages(LaserScan, "scan")
        wait_until(lambda: driver.node.status.state == "working")
        device.write(np.random.default_rng(1).integers(0, 256, 1 << 17, dtype=np.uint8).tobytes())
        with answering(device, nothing, lambda: lidar.turns(0.25)):
            assert_room(seen(driver, scans))
        assert driver.node.status.counters["skipped_bytes"] > 125_000


def test_unplugged_and_plugged_in_again(device: PtyDevice, context: metaros.Context) -> None:
    lidar = Ld19Emulator()
    with running("ld19", {"port": device.path}, context=context) as driver:
        scans = driver.messages(LaserScan, "scan")
        with answering(device, nothing, lambda: lidar.turns(0.25)):
            seen(driver, scans)
        device.unplug()
        wait_until(lambda: driver.state() == "waiting")
        device.replug()
        with answering(device, nothing, lambda: lidar.turns(0.25)):
            assert_room(seen(driver, scans))
            wait_until(lambda: driver.state() == "working")
        assert int(driver.facts()["reconnects"]) >= 1


def test_a_gap_in_its_clock_is_no_turn(device: PtyDevice, context: metaros.Context) -> None:
    lidar = Ld19Emulator()
    with running("ld19", {"port": device.path}, context=context) as driver:
        scans = driver.messages(LaserScan, "scan")
        wait_until(lambda: driver.node.status.state == "working")
        device.write(lidar.turns(0.9))
        lidar.points += 4500
        device.write(lidar.turns(0.9))
        wait_until(lambda: driver.node.status.counters["gaps"] == 1)
        assert scans == []
        with answering(device, nothing, lambda: lidar.turns(0.25)):
            assert_room(seen(driver, scans))


def test_ranges_that_exclude_each_other_are_refused(context: metaros.Context) -> None:
    parameters = {"port": "/dev/null", "range_min_m": 5.0, "range_max_m": 2.0}
    with running("ld19", parameters, context=context, start=False) as driver:
        with pytest.raises(ConfigError, match="range_min_m must be below"):
            driver.node.start()
