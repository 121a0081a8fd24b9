"""The driver: reads the wheels, publishes odometry, and drives what fresh commands say."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from metaros.drivers.context import DriverContext
from metaros.drivers.diff_drive.command import CommandGate
from metaros.drivers.diff_drive.kinematics import Wheels
from metaros.drivers.diff_drive.motor_board import MotorBoard
from metaros.drivers.diff_drive.odometry import Odometer
from metaros.drivers.serial_port import SerialPort
from metaros.errors import UnavailableError
from metaros.interfaces.geometry_msgs.msg import (
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
)
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import JointState
from metaros.interfaces.std_msgs.msg import Header
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.interfaces.tf2_msgs.msg import TFMessage
from metaros.wire import qos_command, qos_default

__all__ = ["DiffDriveDevice", "make"]

BOOT_S: Final = 4.0  # an Arduino starts anew when its port is opened, and its boot loader waits two seconds
SILENT_ASKS: Final = 5  # in a row, about a second; time alone says nothing: it may be this machine that slept
MARGIN: Final = 2.0  # a wheel that runs twice as fast as the limits allow is a jump of its encoder
_STOPPED: Final = "stopped by ~/stop"
_NEVER: Final = 1e-9  # variance of what a base on the floor does not do: leave it


def make(context: DriverContext) -> DiffDriveDevice:
    """A base on the port of the parameters."""
    return DiffDriveDevice(context)


class DiffDriveDevice:
    """Nothing moves without a command that is younger than the watchdog, nor by one from before the board was away."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._wheels = Wheels(
            radius_m=context["wheel_radius"],
            separation_m=context["wheel_separation"],
            ticks_per_turn=context["ticks_per_turn"],
            left_sign=-1 if context["left_inverted"] else 1,
            right_sign=-1 if context["right_inverted"] else 1,
        )
        self._gate = CommandGate(
            max_linear=context["max_linear"],
            max_angular=context["max_angular"],
            linear_acceleration=context["linear_acceleration"],
            angular_acceleration=context["angular_acceleration"],
            watchdog_s=context["watchdog"],
        )
        fastest = max(map(abs, self._wheels.ticks(context["max_linear"], context["max_angular"])))
        fastest = max(fastest, *map(abs, self._wheels.ticks(context["max_linear"], -context["max_angular"])))
        self._odometer = Odometer(self._wheels, max_ticks_s=MARGIN * fastest)
        self._port: SerialPort | None = None
        self._board: MotorBoard | None = None
        self._odometry = context.publisher(Odometry, "odom", qos_default)
        self._transforms = context.publisher(TFMessage, "tf", qos_default, reading=False)
        self._joints = context.publisher(JointState, "joint_states", qos_default, reading=False)
        context.subscription(Twist, "cmd_vel", self._on_command, qos_command)
        context.service(Trigger, "~/stop", self._on_stop)
        context.service(Trigger, "~/release", self._on_release)

    def open(self) -> None:
        """Open the port and wait until the board answers; it is told to stand still."""
        context = self._context
        self._gate.forget()
        self._odometer.begin()
        self._port = SerialPort(context, context["port"], context["baud"])
        self._board = MotorBoard(context, self._port)
        until_s = context.clock.monotonic_s() + BOOT_S
        while self._board.exchange(0, 0) is None:
            if context.stopping:
                return
            if context.clock.monotonic_s() > until_s:
                raise UnavailableError(f"{self._port.port}: the board does not answer")
        self._gate.forget()  # what was commanded while it started is no new command
        context.opened(f"board on {self._port.port}", hardware_id="")
        context.warn(_STOPPED if self._gate.stopped else "")

    def run(self) -> None:
        """Drive, read, publish, `rate` times a second."""
        context, board = self._context, self._board
        assert board is not None
        period_s = 1 / context["rate"]
        asked_s = next_s = context.clock.monotonic_s()
        unanswered = 0
        while not context.stopping:
            if not unanswered:
                asked_s = context.clock.monotonic_s()
            counts = board.exchange(*self._ticks())
            now_s, stamp_ns = context.clock.monotonic_s(), context.clock.wall_ns()
            unanswered = 0 if counts is not None else unanswered + 1
            if counts is not None:
                self._take(counts, asked_s, now_s, stamp_ns)
            elif unanswered >= SILENT_ASKS:
                raise UnavailableError("the board does not answer any more")
            next_s = max(next_s + period_s, now_s)
            context.wait(next_s - now_s)

    def close(self) -> None:
        """Stop the wheels, close the port."""
        port, board = self._port, self._board
        self._port = self._board = None
        self._gate.forget()
        if port is not None:
            try:
                if board is not None:
                    board.stop()
            except UnavailableError:
                pass  # it is gone: the board stops by itself
            finally:
                port.close()

    # -- the wheels ------------------------------------------------------------------------------------------------

    def _ticks(self) -> tuple[int, int]:
        linear, angular = self._gate.speeds(self._context.clock.monotonic_s())
        left, right = self._wheels.ticks(linear, angular)
        pid_rate = self._context["pid_rate"]
        return round(left / pid_rate), round(right / pid_rate)

    def _take(self, counts: tuple[int, int], asked_s: float, now_s: float, stamp_ns: int) -> None:
        context, odometer = self._context, self._odometer
        if not odometer.feed(counts, now_s, error=context["odometry_error"], asked_s=asked_s):
            context.count("encoder_jumps")
            self._gate.forget()  # a board that began anew is not driven on by what it was told before
        header = Header(stamp=context.stamp(stamp_ns), frame_id=context["odom_frame"])
        self._odometry.publish(self._odometry_message(header), stamp_ns=stamp_ns)
        if context["publish_tf"]:
            self._transforms.publish(TFMessage(transforms=[self._transform(header)]), stamp_ns=stamp_ns)
        joints = JointState(header=Header(stamp=header.stamp), name=["left_wheel_joint", "right_wheel_joint"])
        joints.position, joints.velocity = np.array(odometer.angles), np.array(odometer.rates)
        self._joints.publish(joints, stamp_ns=stamp_ns)

    # -- messages --------------------------------------------------------------------------------------------------

    def _odometry_message(self, header: Header) -> Odometry:
        odometer, error = self._odometer, self._context["odometry_error"]
        pose = odometer.pose
        speed_variance = (error * odometer.linear) ** 2 + self._wheels.tick_m**2
        turn_variance = (error * odometer.angular) ** 2 + (self._wheels.tick_m / self._wheels.separation_m) ** 2
        return Odometry(
            header=header,
            child_frame_id=self._context["base_frame"],
            pose=PoseWithCovariance(
                pose=Pose(position=Point(x=pose.x, y=pose.y, z=0.0), orientation=_turned(pose.yaw)),
                covariance=_planar(pose.place_variance, pose.place_variance, pose.yaw_variance),
            ),
            twist=TwistWithCovariance(
                twist=Twist(linear=Vector3(x=odometer.linear), angular=Vector3(z=odometer.angular)),
                covariance=_planar(speed_variance, _NEVER, turn_variance),
            ),
        )

    def _transform(self, header: Header) -> TransformStamped:
        pose = self._odometer.pose
        transform = Transform(translation=Vector3(x=pose.x, y=pose.y, z=0.0), rotation=_turned(pose.yaw))
        return TransformStamped(header=header, child_frame_id=self._context["base_frame"], transform=transform)

    # -- from others -----------------------------------------------------------------------------------------------

    def _on_command(self, message: Twist) -> None:
        if self._board is None:
            self._context.count("refused_commands")  # it is away, and shall not start by this when it is back
        elif not self._gate.command(message.linear.x, message.angular.z, self._context.clock.monotonic_s()):
            self._context.count("refused_commands")

    def _on_stop(self, _: Any, response: Any) -> Any:
        self._gate.stop()
        self._context.warn(_STOPPED)
        response.success, response.message = True, "stopped until ~/release"
        return response

    def _on_release(self, _: Any, response: Any) -> Any:
        self._gate.release()
        self._context.warn("")
        response.success, response.message = True, "obeys new commands"
        return response


def _turned(yaw: float) -> Quaternion:
    return Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def _planar(x: float, y: float, yaw: float) -> Any:
    """A covariance whose other three directions (up, roll, pitch) a base on the floor does not move in."""
    return np.diag([x, y, _NEVER, _NEVER, _NEVER, yaw]).ravel()
