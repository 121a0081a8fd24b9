"""The base's driver against an emulated board whose wheels turn."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random  # noqa: TID251 - seeded
from typing import Any

import pytest

import metaros
from metaros.drivers.diff_drive.motor_board import ANSWER_S
from metaros.interfaces.geometry_msgs.msg import Twist, Vector3
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import JointState
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.interfaces.tf2_msgs.msg import TFMessage
from tests.support.devices.base_emulator import BaseEmulator
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.pty_device import PtyDevice
from tests.support.waiting import wait_until

GEOMETRY: dict[str, Any] = {"wheel_radius": 0.05, "ticks_per_turn": 20_000.0, "pid_rate": 30.0}


class Rig:
    """An emulated base, its driver, and somebody who drives it."""

    def __init__(self, base: BaseEmulator, driver: RunningDriver) -> None:
        self.base = base
        self.driver = driver
        self.odometry: list[Odometry] = driver.messages(Odometry, "odom")
        self._commands = driver.viewer.create_publisher(Twist, "/r1/cmd_vel", metaros.qos_command)

    def send(self, linear: float, angular: float = 0.0) -> None:
        self._commands.publish(Twist(linear=Vector3(x=linear), angular=Vector3(z=angular)))

    def drive(self, linear: float, angular: float, until: Any) -> None:
        def driven() -> bool:
            self.send(linear, angular)
            return bool(until())

        wait_until(driven, every_s=0.01)

    def rest(self) -> None:
        """Stand still, also by the odometry: no reading of it has two movements."""
        self.drive(0.0, 0.0, self.status)
        self.read_anew(self.odometry)

    def read_anew(self, *topics: list[Any]) -> None:
        """Until a reading is there that was asked for after now; what was read before may still be on its way."""
        now_ns = self.driver.node.clock.wall_ns()
        for messages in topics:  # the first answer after now may be to a question before
            wait_until(lambda messages=messages: sum(stamp_ns(message) > now_ns for message in messages[-9:]) > 1)

    def moving(self) -> bool:
        return self.base.targets != (0, 0)

    def status(self) -> bool:
        return self.base.targets == (0, 0)

    def call(self, name: str) -> Any:
        client = self.driver.viewer.create_client(Trigger, f"/r1/diff_drive/{name}")
        return client.call(Trigger.Request(), timeout_s=30.0)

    def place(self) -> tuple[float, float, float]:
        pose = self.odometry[-1].pose.pose
        yaw = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
        return pose.position.x, pose.position.y, yaw


def stamp_ns(message: Any) -> int:
    """When the driver had what it says."""
    stamp = (message.transforms[0] if isinstance(message, TFMessage) else message).header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


@contextmanager
def rig(tmp_path: Path, context: metaros.Context, *, counted: int = 0, **parameters: Any) -> Iterator[Rig]:
    """`counted`: what the board's encoders have counted before the driver asks."""
    with (
        PtyDevice(tmp_path) as device,
        BaseEmulator(device, separation=0.3, wheel_radius=0.05, ticks_per_turn=20_000, pid_rate=30) as base,
    ):
        base.offset = [counted, counted]
        wanted = {"port": device.path, "wheel_separation": 0.3, "rate": 100.0, **GEOMETRY, **parameters}
        with running("diff_drive", wanted, context=context) as driver:
            made = Rig(base, driver)
            wait_until(lambda: made.odometry)
            yield made


def test_a_driven_square_ends_where_the_odometry_says(tmp_path: Path, context: metaros.Context) -> None:
    limits = {"max_linear": 2.0, "max_angular": 8.0, "linear_acceleration": 20.0, "angular_acceleration": 80.0}
    with rig(tmp_path, context, **limits) as made:
        base, yaw = made.base, 0.0
        for side in range(4):
            begin = (base.x, base.y)
            made.drive(1.0, 0.0, lambda at=begin: math.dist(at, (base.x, base.y)) >= 0.2)
            made.rest()
            yaw = (side + 1) * math.pi / 2
            made.drive(0.0, 6.0, lambda goal=yaw: base.yaw >= goal)
            made.rest()
        made.driver.leap(made.driver.node.parameters["watchdog"])
        wait_until(made.status)
        made.read_anew(made.odometry)
        x, y, heading = made.place()
        assert base.yaw > 2 * math.pi - 0.01
        assert math.dist((x, y), (base.x, base.y)) < 0.005
        assert abs(math.remainder(heading - base.yaw, 2 * math.pi)) < 0.01
        last = made.odometry[-1]
        assert (last.header.frame_id, last.child_frame_id) == ("odom", "base_link")
        assert last.twist.twist.linear.x == 0.0
        assert last.pose.covariance[0] > 0.0
        assert last.pose.covariance[35] > 0.0


def test_transforms_and_joints_say_the_same(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        transforms = made.driver.messages(TFMessage, "tf")
        joints = made.driver.messages(JointState, "joint_states")
        made.drive(0.4, 0.0, lambda: joints and transforms and joints[-1].velocity[0] > 1)
        made.driver.leap(made.driver.node.parameters["watchdog"])
        wait_until(made.status)
        made.read_anew(joints, transforms)
        joint, (transform,) = joints[-1], transforms[-1].transforms
        assert list(joint.name) == ["left_wheel_joint", "right_wheel_joint"]
        assert joint.position[0] == pytest.approx(made.base.x / 0.05, abs=0.01)
        assert transform.transform.translation.x == pytest.approx(made.base.x, abs=0.001)
        assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")


def test_without_a_fresh_command_it_stops(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        made.drive(0.4, 0.0, made.moving)
        wait_until(lambda: "m 0 0" in made.base.commands[-2:])  # the driver's stop, not the board's own
        assert made.status()


def test_limits_and_acceleration_hold(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context, max_linear=0.2, linear_acceleration=0.5) as made:
        made.drive(100.0, 0.0, lambda: made.odometry[-1].twist.twist.linear.x > 0.15)
        most = 0.2 / (2 * math.pi * 0.05 / 20_000) / 30
        reported = [int(line.split()[1]) for line in made.base.commands if line.startswith("m")]
        assert max(reported) <= round(most)
        assert any(0 < ticks < most / 2 for ticks in reported)


def test_commands_that_are_no_numbers_are_refused(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        made.drive(math.nan, 0.0, lambda: int(made.driver.facts().get("refused_commands", 0)) > 2)
        made.drive(0.0, -math.inf, lambda: int(made.driver.facts().get("refused_commands", 0)) > 5)
        assert all(line in ("m 0 0", "e") for line in made.base.commands)


def test_stop_holds_until_release_and_a_new_command(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        made.drive(0.4, 0.0, made.moving)
        assert made.call("stop").success
        made.base.commands.clear()
        made.drive(0.4, 0.0, lambda: len(made.base.commands) > 20)
        assert {line for line in made.base.commands[5:] if line != "e"} == {"m 0 0"}
        wait_until(lambda: made.driver.status().message == "stopped by ~/stop")
        assert made.call("release").success
        wait_until(lambda: made.driver.status().message != "stopped by ~/stop")
        assert made.status()
        made.drive(0.4, 0.0, made.moving)


def test_after_replugging_nothing_moves_without_a_new_command(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        made.drive(0.4, 0.0, made.moving)
        made.base.unplug()
        wait_until(lambda: made.driver.state() == "waiting")
        assert "driver error" not in made.driver.status().message
        made.send(0.4)  # while it is away: refused, and not kept
        wait_until(lambda: int(made.driver.facts().get("refused_commands", 0)) > 0)
        made.base.restart()
        made.base.commands.clear()
        made.base.replug()
        place, seen = made.place(), len(made.odometry)
        wait_until(lambda: made.driver.state() == "working" and len(made.odometry) > seen + 10)
        assert {line for line in made.base.commands if line != "e"} == {"m 0 0"}
        assert made.place() == pytest.approx(place, abs=0.01)
        made.drive(0.4, 0.0, made.moving)


def test_it_stops_the_wheels_when_it_is_stopped(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        made.drive(0.4, 0.0, made.moving)
        made.driver.node.trigger("deactivate")
        wait_until(lambda: made.base.commands[-1] == "m 0 0")  # and no question after it
        assert made.status()


def test_a_board_that_began_anew_stands_and_the_place_does_not_jump(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context, counted=1_000_000) as made:  # no wheel turns so far, however late a reading is
        made.drive(0.1, 0.0, lambda: made.base.x > 0.02)
        made.base.restart()
        wait_until(lambda: made.driver.facts().get("encoder_jumps") == "1" or "reconnects" in made.driver.facts())
        wait_until(made.status)
        assert made.place()[0] == pytest.approx(made.base.x, abs=0.05)


def test_encoders_wrap(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        made.base.offset = [2**31 - 3000, 2**31 - 3000]
        wait_until(lambda: int(made.driver.facts().get("encoder_jumps", 0)) == 1)  # the emulator's, once
        made.drive(0.4, 0.0, lambda: made.base.x > 0.1)
        made.driver.leap(made.driver.node.parameters["watchdog"])
        wait_until(made.status)
        wait_until(lambda: made.place()[0] == pytest.approx(made.base.x, abs=0.003))
        assert made.driver.facts()["encoder_jumps"] == "1"


def test_noise_on_the_line_moves_nothing_by_itself(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        rng = Random(2)
        made.base.noise = b"9" * 500 + b"\r\n" + rng.randbytes(200).replace(b"\n", b"") + b"\n"
        seen = len(made.odometry)
        wait_until(lambda: len(made.odometry) > seen + 10)
        assert made.status()
        assert made.place() == pytest.approx((0, 0, 0), abs=1e-9)
        assert int(made.driver.facts()["long_lines"]) > 0
        made.base.noise = b""
        made.drive(0.4, 0.0, lambda: made.odometry[-1].twist.twist.linear.x > 0.2)


def test_a_board_that_falls_silent_is_away_until_it_answers(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        made.base.answers = False
        made.driver.lose(ANSWER_S)
        made.base.answers = True
        wait_until(lambda: made.driver.state() == "working")
        assert made.driver.facts()["reconnects"] == "1"


def test_some_answers_may_be_missing_for_however_long(tmp_path: Path, context: metaros.Context) -> None:
    with rig(tmp_path, context) as made:
        # Once a question, by who has heard it: a leap too many would be over the time of the next one's answer.
        made.base.on_lost_counts = lambda: made.driver.leap(60.0)
        made.base.missing = 2 * 4  # four questions of two things each; a fifth would be one too many
        wait_until(lambda: not made.base.missing)
        seen = len(made.odometry)
        wait_until(lambda: len(made.odometry) > seen + 1)
        assert "reconnects" not in made.driver.facts()
