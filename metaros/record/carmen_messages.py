"""CARMEN records as ROS messages.

A laser of n readings over 180 degrees: reading i lies at -90 degrees + i * (180 / n) degrees, so the last one is one
step short of +90. Ranges are the file's; `range_max` is 49.9 m, so that the loggers' no-return values (50 and 81.8 to
81.9 m) are out of range, as LaserScan says it. Stamps are the log's ipc time.
"""

from __future__ import annotations

import math

from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import LaserScan
from metaros.interfaces.std_msgs.msg import Header
from metaros.interfaces.tf2_msgs.msg import TFMessage
from metaros.record.carmen import LaserLine, OdometryLine

__all__ = ["FIELD_OF_VIEW_RAD", "RANGE_MAX_M", "odometry_message", "scan_message", "tf_message"]

FIELD_OF_VIEW_RAD = math.pi
RANGE_MIN_M = 0.01
RANGE_MAX_M = 49.9


def _header(frame_id: str, stamp_s: float) -> Header:
    stamp_ns = round(stamp_s * 1e6) * 1000  # the logs have microseconds; a float of today's time has no more
    return Header(stamp=Time(sec=stamp_ns // 1_000_000_000, nanosec=stamp_ns % 1_000_000_000), frame_id=frame_id)


def _heading(heading_rad: float) -> Quaternion:
    return Quaternion(z=math.sin(heading_rad / 2), w=math.cos(heading_rad / 2))


def scan_message(name: str, line: LaserLine) -> LaserScan:
    """A front-laser scan in the frame `<name>/laser`."""
    readings = len(line.ranges_m)
    step_rad = FIELD_OF_VIEW_RAD / readings
    return LaserScan(
        header=_header(f"{name}/laser", line.stamp_s),
        angle_min=-FIELD_OF_VIEW_RAD / 2,
        angle_max=-FIELD_OF_VIEW_RAD / 2 + step_rad * (readings - 1),
        angle_increment=step_rad,
        range_min=RANGE_MIN_M,
        range_max=RANGE_MAX_M,
        ranges=line.ranges_m,
    )


def odometry_message(name: str, line: OdometryLine) -> Odometry:
    """Wheel odometry: `<name>/base_link` in `<name>/odom`. Speeds are the file's, which some loggers left at zero."""
    message = Odometry(header=_header(f"{name}/odom", line.stamp_s), child_frame_id=f"{name}/base_link")
    message.pose.pose.position.x, message.pose.pose.position.y = line.pose[:2]
    message.pose.pose.orientation = _heading(line.pose[2])
    message.twist.twist.linear.x = line.linear_m_s
    message.twist.twist.angular.z = line.angular_rad_s
    return message


def tf_message(name: str, line: OdometryLine, *, laser_x_m: float) -> TFMessage:
    """The same pose as a transform, and where the laser is mounted."""
    return TFMessage(
        transforms=[
            TransformStamped(
                header=_header(f"{name}/odom", line.stamp_s),
                child_frame_id=f"{name}/base_link",
                transform=Transform(
                    translation=Vector3(x=line.pose[0], y=line.pose[1]), rotation=_heading(line.pose[2])
                ),
            ),
            TransformStamped(
                header=_header(f"{name}/base_link", line.stamp_s),
                child_frame_id=f"{name}/laser",
                transform=Transform(translation=Vector3(x=laser_x_m), rotation=Quaternion(w=1.0)),
            ),
        ]
    )
