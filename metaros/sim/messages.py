"""A simulated robot's state as ROS messages, in the frames `<robot>/odom`, `base_link`, `laser` and `camera`."""

from __future__ import annotations

import math

import numpy as np

from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from metaros.interfaces.nav_msgs.msg import Odometry as OdometryMessage
from metaros.interfaces.sensor_msgs.msg import BatteryState, CompressedImage, LaserScan, Temperature
from metaros.interfaces.sensor_msgs.msg import Imu as ImuMessage
from metaros.interfaces.std_msgs.msg import Header
from metaros.interfaces.tf2_msgs.msg import TFMessage
from metaros.sim.camera import CAMERA
from metaros.sim.fleet import SimRobot
from metaros.sim.sensors import LIDAR, ImuReading

__all__ = [
    "battery_message",
    "camera_message",
    "header",
    "imu_message",
    "odometry_message",
    "scan_message",
    "temperature_message",
    "tf_message",
]

_UNKNOWN = math.nan  # how BatteryState says that it does not measure something


def header(frame_id: str, stamp_ns: int) -> Header:
    """A header with a stamp in nanoseconds since the epoch."""
    return Header(stamp=Time(sec=stamp_ns // 1_000_000_000, nanosec=stamp_ns % 1_000_000_000), frame_id=frame_id)


def _heading(heading_rad: float) -> Quaternion:
    return Quaternion(z=math.sin(heading_rad / 2), w=math.cos(heading_rad / 2))


def _diagonal(size: int, *values: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    matrix = np.zeros(size * size)
    matrix[:: size + 1] = values
    return matrix


_TWIST_COVARIANCE = _diagonal(6, 1e-4, 1e-6, 1e-6, 1e-6, 1e-6, 4e-4)
_GYRO_COVARIANCE = _diagonal(3, 9e-6, 9e-6, 9e-6)
_ACCEL_COVARIANCE = _diagonal(3, 4e-4, 4e-4, 4e-4)
_ATTITUDE_COVARIANCE = _diagonal(3, 1e-6, 1e-6, 1e-3)


def odometry_message(robot: SimRobot, *, stamp_ns: int) -> OdometryMessage:
    """Where the wheels say the robot is; the uncertainty grows with the way."""
    odometry = robot.odometry
    message = OdometryMessage(header=header(f"{robot.name}/odom", stamp_ns), child_frame_id=f"{robot.name}/base_link")
    message.pose.pose.position.x = odometry.x
    message.pose.pose.position.y = odometry.y
    message.pose.pose.orientation = _heading(odometry.heading_rad)
    spread = 1e-4 + 2e-5 * odometry.travelled_m
    message.pose.covariance = _diagonal(6, spread, spread, 1e-6, 1e-6, 1e-6, spread)
    message.twist.twist.linear.x = odometry.linear_m_s
    message.twist.twist.angular.z = odometry.angular_rad_s
    message.twist.covariance = _TWIST_COVARIANCE
    return message


def scan_message(robot: SimRobot, *, stamp_ns: int) -> LaserScan:
    """The last scan; inf is no return (REP 117)."""
    return LaserScan(
        header=header(f"{robot.name}/laser", stamp_ns),
        angle_min=LIDAR.first_rad,
        angle_max=LIDAR.first_rad + LIDAR.step_rad * (LIDAR.rays - 1),
        angle_increment=LIDAR.step_rad,
        scan_time=1.0 / LIDAR.rate_hz,
        range_min=LIDAR.min_m,
        range_max=LIDAR.max_m,
        ranges=robot.lidar.ranges,
    )


def imu_message(robot: SimRobot, reading: ImuReading, *, stamp_ns: int) -> ImuMessage:
    """Turning speed and specific force."""
    return ImuMessage(
        header=header(f"{robot.name}/base_link", stamp_ns),
        orientation=_heading(reading.heading_rad),
        orientation_covariance=_ATTITUDE_COVARIANCE,
        angular_velocity=Vector3(x=reading.gyro_rad_s[0], y=reading.gyro_rad_s[1], z=reading.gyro_rad_s[2]),
        angular_velocity_covariance=_GYRO_COVARIANCE,
        linear_acceleration=Vector3(x=reading.accel_m_s2[0], y=reading.accel_m_s2[1], z=reading.accel_m_s2[2]),
        linear_acceleration_covariance=_ACCEL_COVARIANCE,
    )


def battery_message(robot: SimRobot, *, stamp_ns: int) -> BatteryState:
    """Charge 0..1; current is negative while discharging, as BatteryState has it."""
    battery = robot.body.battery
    return BatteryState(
        header=header(f"{robot.name}/base_link", stamp_ns),
        voltage=battery.voltage_v,
        temperature=battery.temperature_c,
        current=-battery.current_a,
        charge=battery.charge * battery.capacity_ah,
        capacity=_UNKNOWN,
        design_capacity=battery.capacity_ah,
        percentage=battery.charge,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_CHARGING
        if battery.current_a < 0.0
        else BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_GOOD
        if battery.charge > 0.0
        else BatteryState.POWER_SUPPLY_HEALTH_DEAD,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LION,
        present=True,
        location="base",
        serial_number=f"{robot.name}-battery",
    )


def temperature_message(robot: SimRobot, *, stamp_ns: int) -> Temperature:
    """Of the hotter motor."""
    return Temperature(
        header=header(f"{robot.name}/base_link", stamp_ns), temperature=robot.body.motor_temperature_c, variance=0.04
    )


def camera_message(robot: SimRobot, jpeg: bytes, *, stamp_ns: int) -> CompressedImage:
    """A JPEG picture."""
    return CompressedImage(header=header(f"{robot.name}/camera", stamp_ns), format="jpeg", data=jpeg)


def tf_message(robot: SimRobot, *, stamp_ns: int) -> TFMessage:
    """Odometry as a transform, and where laser and camera are mounted."""
    odometry, name = robot.odometry, robot.name
    return TFMessage(
        transforms=[
            TransformStamped(
                header=header(f"{name}/odom", stamp_ns),
                child_frame_id=f"{name}/base_link",
                transform=Transform(
                    translation=Vector3(x=odometry.x, y=odometry.y), rotation=_heading(odometry.heading_rad)
                ),
            ),
            _mounted(name, "laser", stamp_ns, x=0.0, z=LIDAR.height_m),
            _mounted(name, "camera", stamp_ns, x=CAMERA.forward_m, z=CAMERA.height_m),
        ]
    )


def _mounted(name: str, part: str, stamp_ns: int, *, x: float, z: float) -> TransformStamped:
    return TransformStamped(
        header=header(f"{name}/base_link", stamp_ns),
        child_frame_id=f"{name}/{part}",
        transform=Transform(translation=Vector3(x=x, z=z), rotation=Quaternion(w=1.0)),
    )
