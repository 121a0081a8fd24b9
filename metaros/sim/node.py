"""A simulated robot on the wire: the node `/sim_N/base` around one `SimRobot`. Topics and rates are a table."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import BatteryState, CompressedImage, Imu, LaserScan, Temperature
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.interfaces.tf2_msgs.msg import TFMessage
from metaros.node import Context, Node
from metaros.sim import messages
from metaros.sim.camera import CAMERA, Renderer
from metaros.sim.fleet import RATE_HZ, Fleet, SimRobot, due
from metaros.sim.robot import DRIVE
from metaros.sim.sensors import LIDAR

__all__ = ["PARAMETERS", "TOPICS", "RobotNode", "SimParameter", "SimTopic"]


@dataclass(frozen=True, slots=True)
class SimTopic:
    """A published topic, relative to `/sim_N`, its type and how often a second."""

    topic: str
    type: type[Any]
    rate_hz: float


_CAMERA = SimTopic("camera/image/compressed", CompressedImage, CAMERA.rate_hz)
_SCAN = SimTopic("scan", LaserScan, 10.0)
_ODOM = SimTopic("odom", Odometry, 20.0)
_TF = SimTopic("tf", TFMessage, 20.0)
_IMU = SimTopic("imu", Imu, 50.0)
_BATTERY = SimTopic("battery_state", BatteryState, 1.0)
_MOTOR = SimTopic("motor_temperature", Temperature, 1.0)
TOPICS = (_ODOM, _SCAN, _BATTERY, _IMU, _CAMERA, _TF, _MOTOR)


@dataclass(frozen=True, slots=True)
class SimParameter:
    """A parameter of `/sim_N/base`, its bounds, and the attribute of the robot that it sets."""

    name: str
    low: float
    high: float
    attribute: str
    description: str


PARAMETERS = (
    SimParameter(
        "max_speed", 0.0, DRIVE.max_linear_m_s, "max_speed_m_s", "m/s; the robot drives no faster, whoever drives"
    ),
    SimParameter(
        "resume_after_s", 0.0, math.inf, "gate.resume_after_s", "s without a command until it drives itself again"
    ),
    SimParameter("battery_drain", 0.0, 0.1, "drain_per_s", "part of the charge lost a second, beside what is used"),
    SimParameter("scan_rate", 0.5, LIDAR.rate_hz, "scan_rate_hz", "Hz; laser scans"),
)


class RobotNode:
    """Publishes what its robot senses after each step, and hands it commands, faults, `~/resume` and `~/dock`.

    Everything runs on the thread that spins the executor and steps the fleet, so nothing here is locked.
    """

    def __init__(self, fleet: Fleet, robot: SimRobot, *, context: Context, renderer: Renderer | None) -> None:
        self._fleet = fleet
        self._robot = robot
        self._renderer = renderer
        self._picture: bytes | None = None
        self.node = node = Node("base", namespace=f"/{robot.name}", context=context)
        self._log: dict[str, Callable[[str], None]] = {
            level: getattr(node.get_logger(), level) for level in ("info", "warn", "error")
        }
        topics = [topic for topic in TOPICS if topic is not _CAMERA or renderer is not None]
        self._publishers = {topic: node.create_publisher(topic.type, topic.topic, 10) for topic in topics}
        node.create_subscription(Twist, "cmd_vel", self._on_command, 10)
        node.create_subscription(String, "~/fault", self._on_fault, 10)
        node.create_service(Trigger, "~/resume", self._on_resume)
        node.create_service(Trigger, "~/dock", self._on_dock)
        for parameter in PARAMETERS:
            self._declare(parameter)

    def _declare(self, parameter: SimParameter) -> None:
        """The robot's present value is the default; what is set later the robot has at its next step."""
        part, _, attribute = parameter.attribute.rpartition(".")
        owner = getattr(self._robot, part) if part else self._robot

        def obey(value: float) -> None:
            setattr(owner, attribute, value)
            self._log["info"](f"{parameter.name} is {value:g} now")

        bounds = {"minimum": parameter.low, "maximum": parameter.high}
        default = getattr(owner, attribute)
        value = self.node.declare_parameter(parameter.name, default, description=parameter.description, **bounds)
        setattr(owner, attribute, value)
        self.node.parameters.on_change(parameter.name)(obey)

    def publish(self, tick: int, *, stamp_ns: int) -> None:
        """Send what is due after step `tick`, and the robot's events as log lines."""
        robot = self._robot
        if due(_ODOM.rate_hz, tick):
            self._publishers[_ODOM].publish(messages.odometry_message(robot, stamp_ns=stamp_ns))
            self._publishers[_TF].publish(messages.tf_message(robot, stamp_ns=stamp_ns))
        if robot.scanned:
            self._publishers[_SCAN].publish(messages.scan_message(robot, stamp_ns=stamp_ns))
        if due(_IMU.rate_hz, tick):
            reading = robot.imu.read(robot.body, dt_s=1.0 / RATE_HZ)
            self._publishers[_IMU].publish(messages.imu_message(robot, reading, stamp_ns=stamp_ns))
        if due(_BATTERY.rate_hz, tick):
            self._publishers[_BATTERY].publish(messages.battery_message(robot, stamp_ns=stamp_ns))
            self._publishers[_MOTOR].publish(messages.temperature_message(robot, stamp_ns=stamp_ns))
        if _CAMERA in self._publishers and due(_CAMERA.rate_hz, tick + robot.number):
            self._publishers[_CAMERA].publish(messages.camera_message(robot, self._look(), stamp_ns=stamp_ns))
        for event in robot.events:
            self._log[event.level](event.text)
        robot.events.clear()

    def close(self) -> None:
        """Leave the graph."""
        self.node.close()

    def _look(self) -> bytes:
        """The picture of now, or the last one again when the camera is frozen."""
        assert self._renderer is not None
        if self._picture is None or "camera_freeze" not in self._robot.faults:
            self._picture = self._renderer.jpeg(self._robot.body, self._fleet.numbered_others(self._robot))
        return self._picture

    def _on_command(self, message: Twist) -> None:
        self._robot.command(message.linear.x, message.angular.z, now_s=self.node.clock.monotonic_s())

    def _on_fault(self, message: String) -> None:
        self._robot.inject(message.data)

    def _on_resume(self, _request: Any, response: Any) -> Any:
        response.success, response.message = self._robot.resume()
        return response

    def _on_dock(self, _request: Any, response: Any) -> Any:
        response.success, response.message = self._robot.seek_dock()
        return response
