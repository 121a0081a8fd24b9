"""What may move the vehicle, and what stops it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

import metaros
from metaros.drivers.mavlink.driver import HEARTBEAT_S
from metaros.drivers.mavlink.vehicle import LOST_S
from metaros.drivers.mavlink.velocity import FAREWELL_S
from metaros.interfaces.geometry_msgs.msg import Twist, Vector3
from metaros.interfaces.metaros_msgs.msg import VehicleState
from metaros.interfaces.metaros_msgs.srv import SetMode
from metaros.interfaces.std_srvs.srv import SetBool
from tests.support.devices.autopilot import Autopilot, UdpCable
from tests.support.devices.drivers import RunningDriver, running
from tests.support.ports import free_port
from tests.support.waiting import wait_until

ALLOWED = {"allow_arm": True, "allow_mode": True, "allow_velocity": True}
ARM, MODE = dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_DO_SET_MODE
SETPOINT = "SET_POSITION_TARGET_LOCAL_NED"


@contextmanager
def flying(
    context: metaros.Context, params: dict[str, Any] | None = None, **vehicle: Any
) -> Iterator[tuple[RunningDriver, Autopilot]]:
    port = free_port()
    given = {"link": f"udp:127.0.0.1:{port}", **(ALLOWED if params is None else params)}
    with (
        Autopilot(UdpCable(port), **vehicle) as pilot,
        running("mavlink", given, context=context) as driver,
    ):
        wait_until(lambda: driver.state() == "working")
        yield driver, pilot


def arm(driver: RunningDriver, on: bool) -> Any:
    client = driver.viewer.create_client(SetBool, "/r1/vehicle/arm")
    assert client.wait_for_service(60)
    return client.call(SetBool.Request(data=on), 30)


def set_mode(driver: RunningDriver, mode: str) -> Any:
    client = driver.viewer.create_client(SetMode, "/r1/vehicle/set_mode")
    assert client.wait_for_service(60)
    return client.call(SetMode.Request(mode=mode), 30)


def command(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: float = 0.0) -> Twist:
    return Twist(linear=Vector3(x=x, y=y, z=z), angular=Vector3(z=turn))


def test_without_permission_there_is_nothing_to_command_it_by(context: metaros.Context) -> None:
    with flying(context, {}) as (driver, pilot):
        velocities = driver.viewer.create_publisher(Twist, "/r1/vehicle/cmd_vel", metaros.qos_command)
        states = driver.messages(VehicleState, "vehicle/state", metaros.qos_transient_local)
        clients = [
            driver.viewer.create_client(kind, f"/r1/vehicle/{service}")
            for service, kind in (("arm", SetBool), ("set_mode", SetMode))
        ]
        for _ in range(10):
            velocities.publish(command(1.0))
            seen = len(states)
            wait_until(lambda seen=seen: len(states) > seen)  # type: ignore[misc]
        assert (pilot.commands(ARM), pilot.commands(MODE), pilot.of_type(SETPOINT)) == ([], [], [])
        assert not any(client.service_is_ready() for client in clients)


def test_arm_and_disarm(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        for on in (True, False):
            assert arm(driver, on=on).success
            assert pilot.armed is on
        assert [message.param2 for message in pilot.commands(ARM)] == [0.0, 0.0]  # never forced
        assert {(message.target_system, message.target_component) for message in pilot.commands(ARM)} == {(1, 1)}


def test_a_refusal_is_reported(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        pilot.refuses = dialect.MAV_RESULT_DENIED
        answer = arm(driver, on=True)
        assert (answer.success, answer.message) == (False, "the vehicle answers: denied")
        assert len(pilot.commands(ARM)) == 1


def test_no_answer(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        pilot.deaf_to = 99
        driver.node._device._control.commands._answer_s = 0.05  # type: ignore[union-attr]
        assert arm(driver, on=True).message == "no answer to 3 tries"
        assert not pilot.armed


@pytest.mark.parametrize(
    ("autopilot", "vehicle", "mode", "custom", "sub"),
    [
        (dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, dialect.MAV_TYPE_QUADROTOR, "guided", 4, 0),
        (dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, dialect.MAV_TYPE_GROUND_ROVER, "GUIDED", 15, 0),
        (dialect.MAV_AUTOPILOT_PX4, dialect.MAV_TYPE_QUADROTOR, "LAND", 4, 6),
    ],
)
def test_modes(autopilot: int, vehicle: int, mode: str, custom: int, sub: int, context: metaros.Context) -> None:
    with flying(context, autopilot=autopilot, vehicle=vehicle) as (driver, pilot):
        assert set_mode(driver, mode).success
        (message,) = pilot.commands(MODE)
        assert (message.param1, message.param2, message.param3) == (1, custom, sub)
        answer = set_mode(driver, "WARP")
        assert not answer.success
        assert "no mode 'WARP'; there are " in answer.message
        assert len(pilot.commands(MODE)) == 1


def test_velocity_is_turned_limited_and_ends_by_zero_then_silence(context: metaros.Context) -> None:
    with flying(context, {**ALLOWED, "max_horizontal": 2.0}) as (driver, pilot):
        velocities = driver.viewer.create_publisher(Twist, "/r1/vehicle/cmd_vel", metaros.qos_command)

        def reported() -> bool:
            velocities.publish(command(6.0, 8.0, 0.5, 0.25))
            return bool(pilot.of_type(SETPOINT))

        wait_until(reported, every_s=0.02)
        message = pilot.of_type(SETPOINT)[0]
        assert (message.vx, message.vy, message.vz) == pytest.approx((1.2, -1.6, -0.5))
        assert (message.yaw_rate, message.coordinate_frame, message.type_mask) == (-0.25, 8, 0x5C7)
        driver.leap(driver.node.parameters["watchdog"])
        wait_until(lambda: pilot.of_type(SETPOINT)[-1].vx == 0)
        driver.leap(FAREWELL_S)
        # Silence: ours are still heard (heartbeats), and no setpoint among them.
        wait_until(lambda: driver.node._device._control._gate._until_s == -math.inf)  # type: ignore[union-attr]
        for _ in range(2):
            said, beats = len(pilot.of_type(SETPOINT)), len(pilot.of_type("HEARTBEAT"))
            driver.leap(HEARTBEAT_S)
            wait_until(lambda beats=beats: len(pilot.of_type("HEARTBEAT")) > beats)  # type: ignore[misc]
        assert len(pilot.of_type(SETPOINT)) == said


def test_what_is_no_number_moves_nothing(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        velocities = driver.viewer.create_publisher(Twist, "/r1/vehicle/cmd_vel", metaros.qos_command)

        def refused() -> bool:
            velocities.publish(command(math.nan))
            return int(driver.facts().get("refused_commands", 0)) > 3

        wait_until(refused, every_s=0.02)
        assert pilot.of_type(SETPOINT) == []


def test_after_a_lost_link_nothing_moves_until_a_new_command(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        velocities = driver.viewer.create_publisher(Twist, "/r1/vehicle/cmd_vel", metaros.qos_command)

        def reported() -> bool:
            velocities.publish(command(1.0))
            return bool(pilot.of_type(SETPOINT))

        wait_until(reported, every_s=0.02)
        pilot.silent = True
        driver.lose(LOST_S / 2)
        assert not arm(driver, on=True).success
        for _ in range(10):
            velocities.publish(command(1.0))  # while it is away: refused
        wait_until(lambda: int(driver.facts().get("refused_commands", 0)) > 1)
        pilot.received_all = False
        wait_until(lambda: pilot.received_all)
        pilot.received.clear()
        pilot.silent = False
        wait_until(lambda: driver.state() == "working" and pilot.of_type("HEARTBEAT"))
        beats = len(pilot.of_type("HEARTBEAT"))
        driver.leap(HEARTBEAT_S)
        wait_until(lambda: len(pilot.of_type("HEARTBEAT")) > beats)
        assert (pilot.of_type(SETPOINT), pilot.commands(ARM)) == ([], [])
        assert not pilot.armed
        wait_until(reported, every_s=0.02)


def test_the_driver_s_end_is_a_zero(context: metaros.Context) -> None:
    with flying(context) as (driver, pilot):
        velocities = driver.viewer.create_publisher(Twist, "/r1/vehicle/cmd_vel", metaros.qos_command)

        def reported() -> bool:
            velocities.publish(command(1.0))
            return bool(pilot.of_type(SETPOINT))

        wait_until(reported, every_s=0.02)
        driver.node.trigger("deactivate")
        wait_until(lambda: pilot.of_type(SETPOINT)[-1].vx == 0)


def test_only_the_robot_s_own_settings_allow_it(context: metaros.Context) -> None:
    with flying(context, {}) as (driver, _):
        for name in ALLOWED:
            assert driver.node.parameters.describe(name).read_only
