"""The IMU driver against emulated sensors on a pty."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from random import Random  # noqa: TID251 - seeded

import pytest

import metaros
from metaros.drivers.imu.sample import GRAVITY_M_S2
from metaros.interfaces.sensor_msgs.msg import Imu, MagneticField, Temperature
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.imu_emulator import wit_round
from tests.support.devices.pty_device import PtyDevice
from tests.support.waiting import wait_until


def send_until(device: PtyDevice, data: bytes, condition: Callable[[], object]) -> None:
    """Again and again, as a sensor does."""

    def sent() -> object:
        device.write(data)
        return condition()

    wait_until(sent)


def count(driver: RunningDriver, name: str) -> int:
    return int(driver.facts().get(name, 0))


def test_witmotion_becomes_imu_field_and_temperature(tmp_path: Path, context: metaros.Context) -> None:
    with PtyDevice(tmp_path) as device, running("imu", {"port": device.path}, context=context) as driver:
        samples = driver.messages(Imu, "imu")
        fields = driver.messages(MagneticField, "magnetic_field")
        temperatures = driver.messages(Temperature, "temperature")
        send_until(device, wit_round(), lambda: samples and fields and temperatures)
        sample = samples[-1]
        assert sample.header.frame_id == "imu"
        assert sample.linear_acceleration.z == pytest.approx(GRAVITY_M_S2)
        assert sample.orientation.z == pytest.approx(math.sqrt(0.5), abs=1e-3)  # the device's own
        assert sample.orientation_covariance[8] == pytest.approx(0.02**2)
        assert sample.linear_acceleration_covariance[0] == pytest.approx(0.05**2)
        assert fields[-1].magnetic_field.x == pytest.approx(20e-6)
        assert temperatures[-1].temperature == 25.5


def test_lines_of_numbers_get_the_filters_orientation(tmp_path: Path, context: metaros.Context) -> None:
    with PtyDevice(tmp_path) as device:
        params = {"port": device.path, "protocol": "csv", "acceleration_unit": "g", "rate_unit": "deg/s"}
        with running("imu", params, context=context) as driver:
            samples = driver.messages(Imu, "imu")
            send_until(device, b"0,0.5,0.8660254,0,0,0\r\n", lambda: samples)
            sample = samples[-1]
            assert sample.linear_acceleration.y == pytest.approx(GRAVITY_M_S2 / 2)
            roll = 2 * math.atan2(sample.orientation.x, sample.orientation.w)
            assert roll == pytest.approx(math.pi / 6, abs=0.01)
            assert sample.orientation_covariance[8] == pytest.approx(math.pi**2)  # its yaw is anything


@pytest.mark.parametrize("whose", ["none", "device"])
def test_without_an_orientation_the_message_says_so(tmp_path: Path, context: metaros.Context, whose: str) -> None:
    with PtyDevice(tmp_path) as device:
        with running("imu", {"port": device.path, "orientation": whose}, context=context) as driver:
            samples = driver.messages(Imu, "imu")
            send_until(device, wit_round(angles_deg=None), lambda: samples)
            assert samples[-1].orientation_covariance[0] == -1


def test_noise_is_counted_and_passed_over(tmp_path: Path, context: metaros.Context) -> None:
    with PtyDevice(tmp_path) as device, running("imu", {"port": device.path}, context=context) as driver:
        wait_until(lambda: driver.state() == "working")  # what came before it opened the port is gone
        device.write(Random(9).randbytes(100_000))
        samples = driver.messages(Imu, "imu")
        send_until(device, wit_round(), lambda: len(samples) > 5 and count(driver, "skipped_bytes") > 90_000)
        send_until(device, wit_round(), lambda: driver.state() == "working")
        assert count(driver, "bad_checksum") > 0
        assert count(driver, "reconnects") == 0


def test_what_is_no_number_is_refused(tmp_path: Path, context: metaros.Context) -> None:
    with PtyDevice(tmp_path) as device:
        with running("imu", {"port": device.path, "protocol": "csv"}, context=context) as driver:
            samples = driver.messages(Imu, "imu")
            wrong = b"nan,0,9.8,0,0,0\n0,0,9.8,inf,0,0\n0,0,99999,0,0,0\nax,ay\n"
            send_until(device, wrong, lambda: count(driver, "implausible") > 5 and count(driver, "bad_lines") > 1)
            assert samples == []
            send_until(device, b"\n0,0,9.8,0,0,0\n", lambda: samples)


def test_unplugged_and_plugged_in_again(tmp_path: Path, context: metaros.Context) -> None:
    with PtyDevice(tmp_path) as device, running("imu", {"port": device.path}, context=context) as driver:
        samples = driver.messages(Imu, "imu")
        send_until(device, wit_round(), lambda: samples)
        device.unplug()
        wait_until(lambda: driver.state() == "waiting")
        device.replug()
        samples.clear()
        send_until(device, wit_round(), lambda: samples and driver.state() == "working")
