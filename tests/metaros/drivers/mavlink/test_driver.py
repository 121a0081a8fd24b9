"""The driver against a scripted vehicle, over real UDP, TCP and a pty: what it tells, and what goes wrong."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

import metaros
from metaros.drivers.mavlink.codec import MAX_FRAME
from metaros.drivers.mavlink.vehicle import LOST_S
from metaros.interfaces.metaros_msgs.msg import VehicleState
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import BatteryState, Imu, NavSatFix, NavSatStatus
from metaros.interfaces.std_msgs.msg import Float64
from tests.support.devices.autopilot import Autopilot, PtyCable, TcpCable, UdpCable
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.pty_device import PtyDevice
from tests.support.ports import free_port
from tests.support.waiting import wait_until

KEY = bytes(range(32))


@contextmanager
def flying(context: metaros.Context, **vehicle: Any) -> Iterator[tuple[RunningDriver, Autopilot]]:
    """A driver that hears a vehicle over UDP."""
    port = free_port()
    with (
        Autopilot(UdpCable(port), **vehicle) as pilot,
        running("mavlink", {"link": f"udp:127.0.0.1:{port}"}, context=context) as driver,
    ):
        wait_until(lambda: driver.state() == "working")
        yield driver, pilot


def repeat(
    pilot: Autopilot, message: Any, found: list[Any], *, such: Callable[[Any], object] = lambda _one: True
) -> Any:
    """Send it until something comes of it; the newest. `such` tells it from what earlier messages still bring."""
    found.clear()
    fit: list[Any] = []

    def reported() -> bool:
        pilot.send(message)
        fit[:] = filter(such, list(found))
        return bool(fit)

    wait_until(reported, every_s=0.02)
    return fit[-1]


@pytest.mark.parametrize("kind", ["udp", "udpout", "tcp", "serial"])
def test_state_over_each_link(kind: str, context: metaros.Context, tmp_path: Path) -> None:
    port = free_port()
    with PtyDevice(tmp_path) as pty:
        cable: Any = {"udp": UdpCable, "tcp": TcpCable}.get(kind, UdpCable)(port) if kind != "serial" else PtyCable(pty)
        link = f"{kind}:127.0.0.1:{port}"
        if kind == "udpout":  # the vehicle is the one that listens
            cable._socket.bind(("127.0.0.1", port))
            cable = _Answering(cable)
        with (
            Autopilot(cable, vehicle=dialect.MAV_TYPE_SUBMARINE) as pilot,
            running("mavlink", {"link": pty.path if kind == "serial" else link}, context=context) as driver,
        ):
            states = driver.messages(VehicleState, "vehicle/state", metaros.qos_transient_local)
            pilot.mode, pilot.armed = 2, True
            wait_until(lambda: states and states[-1].armed and states[-1].mode == "ALT_HOLD")
            state = states[-1]
            assert (state.connected, state.vehicle, state.autopilot) == (True, "submarine", "ardupilot")
            wait_until(lambda: state.status in ("active", "standby") and pilot.of_type("HEARTBEAT"))
            ours = pilot.of_type("HEARTBEAT")[0]
            assert (ours.type, ours.autopilot, ours.get_srcSystem()) == (6, 8, 255)
            wait_until(lambda: driver.state() == "working")
            assert driver.facts()["target"] == "1.1"


class _Answering(UdpCable):
    """Sends to whoever spoke last."""

    def __init__(self, cable: UdpCable) -> None:
        self._socket, self._there = cable._socket, ("127.0.0.1", 9)

    def read(self) -> bytes:
        try:
            data, self._there = self._socket.recvfrom(65535)
        except BlockingIOError:
            return b""
        return data


def test_telemetry(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        imus = driver.messages(Imu, "vehicle/imu")
        places = driver.messages(Odometry, "vehicle/odom")
        fixes = driver.messages(NavSatFix, "vehicle/fix")
        batteries = driver.messages(BatteryState, "vehicle/battery")
        headings = driver.messages(Float64, "vehicle/heading")

        # Nose east, rolling to the right and turning to the right; first without, then with an acceleration.
        attitude = dialect.MAVLink_attitude_message(1, 0.0, 0.0, math.pi / 2, 0.1, 0.2, 0.3)
        imu = repeat(pilot, attitude, imus)
        assert imu.linear_acceleration_covariance[0] == -1
        q, rates = imu.orientation, imu.angular_velocity
        assert (abs(q.w), abs(q.x), abs(q.y), abs(q.z)) == pytest.approx((1, 0, 0, 0), abs=1e-6)
        assert (rates.x, rates.y, rates.z) == pytest.approx((0.1, -0.2, -0.3), abs=1e-6)

        def with_acceleration() -> bool:
            pilot.send(dialect.MAVLink_scaled_imu_message(1, 100, 200, -1000, 0, 0, 0, 0, 0, 0))
            pilot.send(attitude)
            return any(one.linear_acceleration_covariance[0] != -1 for one in imus)

        wait_until(with_acceleration, every_s=0.02)
        felt = next(one for one in imus if one.linear_acceleration_covariance[0] != -1).linear_acceleration
        assert (felt.x, felt.y, felt.z) == pytest.approx((0.980665, -1.96133, 9.80665), abs=1e-5)

        # Going east at 3 m/s with the nose east is going forward.
        def moving() -> bool:
            pilot.send(attitude)
            pilot.send(dialect.MAVLink_local_position_ned_message(1, 10.0, 20.0, -30.0, 0.0, 3.0, 0.5))
            return bool(places)

        wait_until(moving, every_s=0.02)
        place, speed = places[-1].pose.pose.position, places[-1].twist.twist.linear
        assert (place.x, place.y, place.z) == pytest.approx((20, 10, 30))
        assert (speed.x, speed.y, speed.z) == pytest.approx((3, 0, -0.5), abs=1e-5)

        no_fix = repeat(pilot, dialect.MAVLink_gps_raw_int_message(0, 0, 0, 0, 0, 0xFFFF, 0xFFFF, 0, 0, 0), fixes)
        assert (no_fix.status.status, math.isnan(no_fix.latitude)) == (NavSatStatus.STATUS_NO_FIX, True)
        gps = dialect.MAVLink_gps_raw_int_message(0, 6, 481000000, 115000000, 545000, 0, 0, 0, 0, 12, 592000, 20, 30)
        fix = repeat(pilot, gps, fixes, such=lambda one: one.status.status != NavSatStatus.STATUS_NO_FIX)
        assert fix.altitude == pytest.approx(592.0)
        here = dialect.MAVLink_global_position_int_message(0, 481234567, 115000000, 546000, 0, 0, 0, 0, 0)

        def own_estimate() -> bool:
            pilot.send(here)
            return bool(fixes[-1].latitude == pytest.approx(48.1234567))

        wait_until(own_estimate, every_s=0.02)
        assert fixes[-1].altitude == pytest.approx(593.0)
        assert fixes[-1].status.status == NavSatStatus.STATUS_GBAS_FIX
        assert list(fixes[-1].position_covariance[[0, 8]]) == pytest.approx([0.0004, 0.0009])

        power = dialect.MAVLink_battery_status_message(0, 0, 0, 2500, [4100, 4000, 3900, *[0xFFFF] * 7], 1234, 0, 0, 77)
        battery = repeat(pilot, power, batteries)
        assert (battery.voltage, battery.current, battery.percentage) == pytest.approx((12.0, -12.34, 0.77))
        assert len(battery.cell_voltage) == 3
        assert repeat(pilot, dialect.MAVLink_vfr_hud_message(1, 2, 271, 40, 5, 6), headings).data == 271


def test_values_that_are_none_are_counted(context: metaros.Context) -> None:
    nan = math.nan
    with flying(context) as (driver, pilot):
        imus = driver.messages(Imu, "vehicle/imu")
        repeat(pilot, dialect.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0), imus)
        for message in (
            dialect.MAVLink_attitude_message(1, nan, 0, 0, 0, 0, 0),
            dialect.MAVLink_attitude_quaternion_message(1, 0, 0, 0, 0, 0, 0, 0),
            dialect.MAVLink_local_position_ned_message(1, nan, 0, 0, 0, 0, 0),
            dialect.MAVLink_highres_imu_message(1, nan, *[0.0] * 12, 0),
            dialect.MAVLink_global_position_int_message(0, 2**31 - 1, 1, 0, 0, 0, 0, 0, 0),
            dialect.MAVLink_vfr_hud_message(nan, nan, 0, 0, nan, nan),
        ):
            pilot.send(message)
        wait_until(lambda: int(driver.facts().get("bad_values", 0)) == 5)
        assert all(math.isfinite(imu.orientation.w) for imu in imus)


def test_telemetry_is_asked_for(context: metaros.Context) -> None:
    with flying(context) as (_, pilot):
        number = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
        wait_until(lambda: len(pilot.commands(number)) >= 10)
        asked = {int(message.param1): message.param2 for message in pilot.commands(number)}
        assert (asked[30], asked[33], asked[1]) == (100_000, 200_000, 1_000_000)


def test_it_goes_away_and_returns(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        states = driver.messages(VehicleState, "vehicle/state", metaros.qos_transient_local)
        pilot.armed = True
        wait_until(lambda: states and states[-1].armed)
        pilot.silent = True
        driver.lose(LOST_S / 2)
        wait_until(lambda: not states[-1].connected)
        assert (states[-1].armed, states[-1].mode, states[-1].status) == (False, "", "lost")
        pilot.silent = False
        wait_until(lambda: driver.state() == "working" and states[-1].connected and states[-1].armed)


def test_tcp_and_serial_that_go_away(context: metaros.Context, tmp_path: Path) -> None:
    port = free_port()
    with running("mavlink", {"link": f"tcp:127.0.0.1:{port}"}, context=context) as driver:
        wait_until(lambda: driver.state() == "waiting")
        for _ in range(2):
            with Autopilot(TcpCable(port)):
                wait_until(lambda: driver.state() == "working")
            wait_until(lambda: driver.state() == "waiting")
    with (
        PtyDevice(tmp_path) as pty,
        Autopilot(PtyCable(pty)) as pilot,
        running("mavlink", {"link": pty.path}, context=context) as driver,
    ):
        wait_until(lambda: driver.state() == "working")
        pilot.silent = True
        pty.unplug()
        wait_until(lambda: driver.state() == "waiting")
        pty.replug()
        pilot.silent = False
        wait_until(lambda: driver.state() == "working")


def test_others_on_the_link_are_not_it(context: metaros.Context, tmp_path: Path) -> None:
    # One serial radio brings a ground station, a gimbal, the vehicle and another vehicle.
    with PtyDevice(tmp_path) as pty, Autopilot(PtyCable(pty), system=7) as pilot:
        pilot.silent = True
        ground, gimbal, other = (
            dialect.MAVLink(pilot, srcSystem=s, srcComponent=c) for s, c in ((254, 190), (7, 154), (8, 1))
        )
        others = (
            (ground, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)),
            (gimbal, dialect.MAVLink_heartbeat_message(26, 8, 0, 0, 4, 3)),
        )
        with running("mavlink", {"link": pty.path}, context=context) as driver:
            states = driver.messages(VehicleState, "vehicle/state", metaros.qos_transient_local)
            for _ in range(3):
                for sender, message in others:
                    sender.send(message)
            wait_until(lambda: "no heartbeat" in driver.status().message or driver.leap(LOST_S / 2))
            pilot.silent = False
            wait_until(lambda: driver.state() == "working")
            for _ in range(5):
                other.send(dialect.MAVLink_heartbeat_message(10, 3, 1, 15, 4, 3))
            wait_until(lambda: int(driver.facts().get("other_systems", 0)) >= 5)
            wait_until(lambda: states)
            assert {state.vehicle for state in states} == {"copter"}
            assert driver.facts()["target"] == "7.1"


def test_a_second_sender_on_the_port_is_not_believed(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        pilot.mode = 5
        states = driver.messages(VehicleState, "vehicle/state", metaros.qos_transient_local)
        wait_until(lambda: states and states[-1].mode == "LOITER")
        with Autopilot(UdpCable(pilot._cable._there[1])) as forger:  # the same system id from another port
            forger.mode = 9
            wait_until(lambda: int(driver.facts().get("foreign_packets", 0)) >= 10)
            assert {state.mode for state in states if state.connected} <= {"STABILIZE", "LOITER"}
            assert forger.received == []


def test_a_megabyte_of_garbage(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        imus = driver.messages(Imu, "vehicle/imu")
        for _ in range(1000):
            pilot.write(os.urandom(1000) + b"\xfd")
        wait_until(lambda: int(driver.facts().get("garbage_bytes", 0)) > 10 * MAX_FRAME)
        repeat(pilot, dialect.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0), imus)
        assert driver.state() == "working"


def test_texts_of_the_vehicle_come_into_the_log(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        lines: list[str] = []
        for level in ("error", "warn", "info"):
            setattr(driver.node._context.log, level, lines.append)  # type: ignore[union-attr]
        pilot.send(dialect.MAVLink_statustext_message(2, b"Pre\x1bArm: no compass"))
        pilot.send(dialect.MAVLink_statustext_message(6, b"a" * 50, 9, 0))
        pilot.send(dialect.MAVLink_statustext_message(6, b"b" * 5, 9, 1))
        wait_until(lambda: len(lines) == 2)
        assert lines == ["vehicle: Pre?Arm: no compass", "vehicle: " + "a" * 50 + "b" * 5]
        for _ in range(100):
            pilot.send(dialect.MAVLink_statustext_message(6, b"talk"))
        wait_until(lambda: int(driver.facts().get("untold_texts", 0)) > 50)


def test_signed_links(context: metaros.Context, tmp_path: Path) -> None:
    file, port = tmp_path / "vehicle.key", free_port()
    file.write_text(KEY.hex())
    params = {"link": f"udp:127.0.0.1:{port}", "signing_key_file": str(file)}
    with running("mavlink", params, context=context) as driver:
        with Autopilot(UdpCable(port)):
            wait_until(lambda: int(driver.facts().get("bad_frames", 0)) > 5)
            assert driver.state() != "working"
        timestamp = (driver.node.clock.wall_ns() - 1_420_070_400 * 10**9) // 10_000
        with Autopilot(UdpCable(port), key=KEY, timestamp=timestamp) as pilot:
            wait_until(lambda: driver.state() == "working" and pilot.of_type("HEARTBEAT"))
            assert pilot.of_type("HEARTBEAT")[-1]._header.incompat_flags == 1


@pytest.mark.parametrize(
    ("params", "why"),
    [
        ({"link": ""}, "link is empty"),
        ({"link": "udp:nowhere"}, "is no udp:HOST:PORT"),
        ({"link": "tcp:a:99999"}, "is no tcp:HOST:PORT"),
        ({"signing_key_file": "/nonexistent/key"}, "No such file"),
    ],
)
def test_what_cannot_work_is_refused(params: dict[str, str], why: str, context: metaros.Context) -> None:
    with running("mavlink", params, context=context, start=False) as driver:
        with pytest.raises(metaros.errors.ConfigError, match=why):
            driver.node.start()
