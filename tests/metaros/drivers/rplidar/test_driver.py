"""The RPLIDAR driver on a pty: both modes, bad health, late and wrong answers, garbage, unplugging."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import metaros
from metaros.drivers.rplidar import connection
from metaros.drivers.rplidar.connection import ANSWER_S
from metaros.drivers.rplidar.driver import SILENT_S
from metaros.interfaces.sensor_msgs.msg import LaserScan
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.pty_device import PtyDevice
from tests.support.devices.room import AHEAD_M, BEHIND_M, LEFT_M, RIGHT_M
from tests.support.devices.rplidar_emulator import RplidarEmulator
from tests.support.devices.serial_peer import answering
from tests.support.waiting import wait_until


@pytest.fixture
def device(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(tmp_path) as made:
        yield made


def scanning(lidar: RplidarEmulator) -> bytes:
    return lidar.samples(96) if lidar.scanning else b""


def assert_room(scan: LaserScan) -> None:
    """Its walls are where they are."""
    at = {degrees: nearest(scan, degrees) for degrees in (-90, 0, 90, 178)}
    assert at == pytest.approx({-90: RIGHT_M, 0: AHEAD_M, 90: LEFT_M, 178: BEHIND_M}, abs=0.02)


def nearest(scan: LaserScan, degrees: float) -> float:
    """The range at an angle, or beside it where no ray fell."""
    middle = round((degrees + 180) / 360 * len(scan.ranges))
    around = np.array(scan.ranges[middle - 2 : middle + 3])
    return float(np.nanmedian(around))


def together(scans: list[LaserScan]) -> LaserScan:
    """What most of them say."""
    ranges = np.ma.masked_invalid(np.stack([np.array(scan.ranges) for scan in scans]))
    return LaserScan(ranges=np.ma.median(ranges, axis=0).filled(np.nan).astype(np.float32))


def seen(scans: list[LaserScan], more: int = 2) -> LaserScan:
    """The newest scan once so many more have come."""
    goal = len(scans) + more
    wait_until(lambda: len(scans) >= goal)
    return scans[-1]


def reported(driver: RunningDriver, **wanted: Any) -> None:
    """Wait until the diagnostics have these values."""
    wait_until(lambda: wanted.items() <= driver.facts().items())


def unanswered(driver: RunningDriver, asked: Callable[[], bool], onward: Callable[[], bool]) -> None:
    """Once it has asked, let the time for the answer go by until it does something else."""
    wait_until(asked)
    wait_until(lambda: onward() or driver.leap(ANSWER_S / 2))


@pytest.mark.parametrize(
    ("mode", "express", "found"),
    [
        ("auto", True, "express"),
        ("auto", False, "standard"),
        ("standard", True, "standard"),
        ("express", True, "express"),
    ],
)
def test_scans_of_a_room(device: PtyDevice, context: metaros.Context, mode: str, express: bool, found: str) -> None:
    lidar = RplidarEmulator(device.write, express=express)
    parameters = {"port": device.path, "mode": mode}
    with answering(device, lidar.heard, lambda: scanning(lidar)):
        with running("rplidar", parameters, context=context) as driver:
            scans = driver.messages(LaserScan, "scan")
            if mode == "auto" and not express:
                unanswered(driver, lambda: 0x82 in lidar.commands, lambda: 0x20 in lidar.commands)
            assert_room(seen(scans))
            reported(driver, mode=found, firmware="1.29", health="good", state="working")
            assert "RPLIDAR A1" in driver.status().message or "RPLIDAR A1" in driver.node.status.detail
            assert driver.status().hardware_id == bytes(range(16)).hex().upper()
        wait_until(lambda: lidar.scanning is None)  # it is told to stop


def test_an_old_firmware_is_not_asked_for_express_scans(device: PtyDevice, context: metaros.Context) -> None:
    lidar = RplidarEmulator(device.write)
    lidar.firmware = (1, 15)
    with answering(device, lidar.heard, lambda: scanning(lidar)):
        with running("rplidar", {"port": device.path}, context=context) as driver:
            assert_room(seen(driver.messages(LaserScan, "scan")))
    assert 0x82 not in lidar.commands


def test_an_a2_is_reported_how_fast_to_turn(device: PtyDevice, context: metaros.Context) -> None:
    lidar = RplidarEmulator(device.write, model=0x28)
    with answering(device, lidar.heard, lambda: scanning(lidar)):
        with running("rplidar", {"port": device.path}, context=context) as driver:
            assert_room(seen(driver.messages(LaserScan, "scan")))
    assert lidar.pwm == [660]


@pytest.fixture
def soon_rebooted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "REBOOT_S", 0.05)


@pytest.mark.usefixtures("soon_rebooted")
def test_bad_health_is_reset(device: PtyDevice, context: metaros.Context) -> None:
    lidar = RplidarEmulator(device.write)
    lidar.status = 2
    with answering(device, lidar.heard, lambda: scanning(lidar)):
        with running("rplidar", {"port": device.path}, context=context) as driver:
            assert_room(seen(driver.messages(LaserScan, "scan")))
            reported(driver, resets="1", health="good")
    assert 0x40 in lidar.commands


@pytest.mark.usefixtures("soon_rebooted")
def test_bad_health_that_stays_is_said_and_tried_again(device: PtyDevice, context: metaros.Context) -> None:
    lidar = RplidarEmulator(device.write)
    lidar.status, lidar.heals = 2, False
    with answering(device, lidar.heard, lambda: scanning(lidar)):
        with running("rplidar", {"port": device.path}, context=context) as driver:
            wait_until(lambda: "health is bad (code 32769)" in driver.status().message)
            scans = driver.messages(LaserScan, "scan")
            lidar.heals = True
            assert_room(seen(scans))


def test_a_warning_is_reported(device: PtyDevice, context: metaros.Context) -> None:
    lidar = RplidarEmulator(device.write)
    lidar.status = 1
    with answering(device, lidar.heard, lambda: scanning(lidar)):
        with running("rplidar", {"port": device.path}, context=context) as driver:
            reported(driver, health="warning")
            wait_until(lambda: "health: warning" in driver.status().message)


def test_answers_that_come_late_or_are_of_another_question(device: PtyDevice, context: metaros.Context) -> None:
    lidar = RplidarEmulator(device.write)
    lidar.mute, lidar.wrong_answers = 2, True
    with answering(device, lidar.heard, lambda: scanning(lidar)):
        with running("rplidar", {"port": device.path}, context=context, start=False) as driver:
            # Once a question, by who has heard it: a leap too many would be over the time of the next one's answer.
            lidar.on_mute = lambda: driver.leap(2 * ANSWER_S)
            scans = driver.messages(LaserScan, "scan")
            driver.node.start()
            assert_room(seen(scans))
            assert lidar.commands.count(0x50) >= 3
            assert int(driver.facts()["asked_again"]) >= 2
            assert int(driver.facts()["wrong_answers"]) >= 3


def test_a_device_that_is_none_is_said(device: PtyDevice, context: metaros.Context) -> None:
    received = bytearray()
    with answering(device, received.extend, lambda: b"$GPGGA,,,,,,0,,,,,,,,*66\r\n"):
        with running("rplidar", {"port": device.path}, context=context) as driver:
            unanswered(driver, lambda: bool(received), lambda: "no RPLIDAR answers here" in driver.status().message)
        wait_until(lambda: received.count(b"\xa5\x50") >= 3)


@pytest.mark.parametrize("express", [True, False])
def test_through_garbage(device: PtyDevice, context: metaros.Context, express: bool) -> None:
    lidar, noise = RplidarEmulator(device.write, express=express), np.random.default_rng(3)

    def dirty() -> bytes:
        if not lidar.scanning:
            return b""
        data = bytearray(lidar.samples(1024))
        data[2000] ^= 0x08
        data[2500] ^= 0x01
        return bytes(data) + noise.integers(0, 256, 333, dtype=np.uint8).tobytes()

    with answering(device, lidar.heard, dirty):
        with running("rplidar", {"port": device.path}, context=context) as driver:
            scans = driver.messages(LaserScan, "scan")
            seen(scans, 8)
            assert_room(together(scans))  # of each one garbage takes a sector away
            bad = "bad_checksum" if express else "bad_check"
            wait_until(lambda: int(driver.facts().get(bad, 0)) > 0)
            wait_until(lambda: int(driver.facts().get("skipped_bytes", 0)) > 300)


def test_unplugged_and_plugged_in_again(device: PtyDevice, context: metaros.Context) -> None:
    lidar = RplidarEmulator(device.write)
    with answering(device, lidar.heard, lambda: scanning(lidar)):
        with running("rplidar", {"port": device.path}, context=context) as driver:
            scans = driver.messages(LaserScan, "scan")
            seen(scans)
            device.unplug()
            lidar.scanning = None
            reported(driver, state="waiting")
            device.replug()
            assert_room(seen(scans))
            reported(driver, state="working")


def test_one_that_falls_silent_is_asked_anew(device: PtyDevice, context: metaros.Context) -> None:
    lidar = RplidarEmulator(device.write)
    with answering(device, lidar.heard, lambda: scanning(lidar)):
        with running("rplidar", {"port": device.path}, context=context) as driver:
            scans = driver.messages(LaserScan, "scan")
            seen(scans)
            lidar.scanning = None  # it lost its power for a moment
            driver.lose(SILENT_S / 2)
            assert_room(seen(scans))
