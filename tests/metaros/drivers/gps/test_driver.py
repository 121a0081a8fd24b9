"""The GPS driver against an emulated receiver on a pty, and on TCP."""

from __future__ import annotations

import itertools
import math
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from random import Random  # noqa: TID251 - seeded

import pytest

import metaros
from metaros.drivers.gps.reader import pvt_request
from metaros.interfaces.geometry_msgs.msg import TwistStamped
from metaros.interfaces.sensor_msgs.msg import NavSatFix, NavSatStatus, TimeReference
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.gps_emulator import nmea_epoch, nmea_no_fix, pvt
from tests.support.devices.pty_device import PtyDevice
from tests.support.waiting import wait_until

UTC_S = 1_774_269_300  # 23 March 2026, 12:35


def send_until(device: PtyDevice, epoch: Callable[[int], bytes], condition: Callable[[], object]) -> None:
    """Epoch after epoch, as a receiver does, until it is so."""
    seconds = itertools.cycle(range(60))

    def sent() -> object:
        device.write(epoch(next(seconds)))
        return condition()

    wait_until(sent, every_s=0.02)


def count(driver: RunningDriver, name: str) -> int:
    return int(driver.facts().get(name, 0))


def test_nmea_becomes_fix_velocity_and_time(tmp_path: Path, context: metaros.Context) -> None:
    with PtyDevice(tmp_path) as device, running("gps", {"port": device.path}, context=context) as driver:
        fixes = driver.messages(NavSatFix, "fix")
        velocities = driver.messages(TwistStamped, "velocity")
        times = driver.messages(TimeReference, "time_reference")
        send_until(device, nmea_epoch, lambda: fixes and velocities and times and count(driver, "satellites") == 8)
        fix, velocity, time = fixes[-1], velocities[-1], times[-1]
        assert (fix.latitude, fix.longitude) == (pytest.approx(48.1173), pytest.approx(11.5166666))
        assert fix.altitude == pytest.approx(592.3)
        assert (fix.status.status, fix.header.frame_id) == (NavSatStatus.STATUS_FIX, "gps")
        assert fix.position_covariance_type == NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
        assert list(fix.position_covariance) == pytest.approx([0.81, 0, 0, 0, 0.64, 0, 0, 0, 2.25])
        assert velocity.twist.linear.x == pytest.approx(11.47, abs=0.01)
        assert UTC_S <= time.time_ref.sec < UTC_S + 60
        send_until(device, nmea_epoch, lambda: driver.state() == "working")
        assert driver.facts()["hdop"] == "0.9"


def test_hdop_gives_the_covariance_where_no_accuracy_is_reported(tmp_path: Path, context: metaros.Context) -> None:
    params = {"port": "", "uere": 2.0, "delay": 0.5}
    with PtyDevice(tmp_path) as device:
        with running("gps", params | {"port": device.path}, context=context) as driver:
            fixes = driver.messages(NavSatFix, "fix")
            send_until(device, lambda second: nmea_epoch(second, gst=False), lambda: fixes)
            assert fixes[-1].position_covariance_type == NavSatFix.COVARIANCE_TYPE_APPROXIMATED
            assert fixes[-1].position_covariance[0] == pytest.approx(1.8**2)


def test_without_a_fix_there_is_nan_and_a_warning_until_there_is_one(tmp_path: Path, context: metaros.Context) -> None:
    with PtyDevice(tmp_path) as device, running("gps", {"port": device.path}, context=context) as driver:
        fixes = driver.messages(NavSatFix, "fix")
        send_until(device, lambda _: nmea_no_fix(), lambda: fixes and driver.status().message == "no fix")
        assert fixes[-1].status.status == NavSatStatus.STATUS_NO_FIX
        assert math.isnan(fixes[-1].latitude)
        assert fixes[-1].position_covariance_type == NavSatFix.COVARIANCE_TYPE_UNKNOWN
        send_until(device, nmea_epoch, lambda: driver.status().message.startswith("reading"))


def test_a_receiver_that_talks_both_is_received_by_ubx(tmp_path: Path, context: metaros.Context) -> None:
    with PtyDevice(tmp_path) as device, running("gps", {"port": device.path}, context=context) as driver:
        fixes = driver.messages(NavSatFix, "fix")
        send_until(device, lambda second: pvt(second=second) + nmea_epoch(second), lambda: len(fixes) > 5)
        assert {round(fix.latitude, 4) for fix in fixes} == {48.1}
        wait_until(lambda: driver.facts().get("protocol") == "UBX")


def test_noise_costs_no_more_than_what_it_hit_and_is_counted(tmp_path: Path, context: metaros.Context) -> None:
    rng = Random(1)
    with PtyDevice(tmp_path) as device, running("gps", {"port": device.path}, context=context) as driver:
        fixes = driver.messages(NavSatFix, "fix")
        wait_until(lambda: driver.state() == "working")  # what came before it opened the port is gone
        device.write(rng.randbytes(100_000))
        send_until(device, nmea_epoch, lambda: fixes)
        device.write(nmea_epoch(1).replace(b"4807", b"4808"))
        wait_until(lambda: count(driver, "bad_checksum") > 0 and count(driver, "skipped_bytes") > 90_000)
        send_until(device, nmea_epoch, lambda: driver.state() == "working")
        assert count(driver, "reconnects") == 0
        assert {round(fix.latitude, 3) for fix in fixes} == {48.117}


def test_unplugged_and_plugged_in_again(tmp_path: Path, context: metaros.Context) -> None:
    with PtyDevice(tmp_path) as device, running("gps", {"port": device.path}, context=context) as driver:
        fixes = driver.messages(NavSatFix, "fix")
        send_until(device, nmea_epoch, lambda: fixes)
        device.unplug()
        wait_until(lambda: driver.state() == "waiting")
        device.replug()
        fixes.clear()
        send_until(device, nmea_epoch, lambda: fixes and driver.state() == "working")


def test_u_blox_is_asked_for_nav_pvt_only_where_that_is_wanted(tmp_path: Path, context: metaros.Context) -> None:
    for wanted, expected in ((False, b""), (True, pvt_request())):
        with PtyDevice(tmp_path) as device:
            params = {"port": device.path, "request_pvt": wanted}
            with running("gps", params, context=context) as driver:
                fixes = driver.messages(NavSatFix, "fix")
                send_until(device, lambda second: pvt(second=second), lambda: fixes)  # noqa: B023
                assert device.read() == expected


def test_a_stream_over_tcp_is_a_port_too(context: metaros.Context) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        server.settimeout(60)
        stop = threading.Event()

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                for second in itertools.cycle(range(60)):
                    if stop.wait(0.02):
                        return
                    connection.sendall(nmea_epoch(second))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            with running("gps", {"port": f"socket://127.0.0.1:{port}"}, context=context) as driver:
                fixes = driver.messages(NavSatFix, "fix")
                wait_until(lambda: fixes)
                stop.set()
                thread.join(60)
                wait_until(lambda: driver.state() == "waiting")  # the server hung up
        finally:
            stop.set()
            thread.join(60)
