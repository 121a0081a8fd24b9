"""The vehicle's telemetry as ROS messages. Each message is stamped with its arrival."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from metaros.drivers.context import DriverContext
from metaros.drivers.mavlink.frames import (
    Quaternion as Wxyz,
)
from metaros.drivers.mavlink.frames import (
    enu_of_ned,
    flu_of_frd,
    into_body,
    orientation_of_euler,
    orientation_of_quaternion,
)
from metaros.drivers.mavlink.position import PositionPublisher
from metaros.drivers.mavlink.power import Power
from metaros.drivers.mavlink.status_text import StatusTextLog
from metaros.interfaces.geometry_msgs.msg import (
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Twist,
    TwistWithCovariance,
    Vector3,
)
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import Imu
from metaros.interfaces.std_msgs.msg import Float64, Header

__all__ = ["STREAMS", "Telemetry"]

# Message ids and the share of `rate` at which each is asked for.
STREAMS: Final[Mapping[int, float]] = {
    31: 1.0,  # ATTITUDE_QUATERNION
    30: 1.0,  # ATTITUDE
    26: 1.0,  # SCALED_IMU
    105: 1.0,  # HIGHRES_IMU
    32: 1.0,  # LOCAL_POSITION_NED
    33: 0.5,  # GLOBAL_POSITION_INT
    24: 0.2,  # GPS_RAW_INT
    74: 0.2,  # VFR_HUD
    1: 0.1,  # SYS_STATUS
    147: 0.1,  # BATTERY_STATUS
}
_G: Final = 9.80665
_FRESH_S: Final = 1.0


class Telemetry:
    """Takes the target's messages, one by one, on the driver's thread."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._imus = context.publisher(Imu, "vehicle/imu")
        self._odometry = context.publisher(Odometry, "vehicle/odom")
        self._hud = {
            name: context.publisher(Float64, f"vehicle/{name}", reading=False)
            for name in ("airspeed", "heading", "throttle", "climb")
        }
        places, power, texts = PositionPublisher(context), Power(context), StatusTextLog(context)
        self._takers: Mapping[str, Callable[[Any], None]] = {
            "ATTITUDE": self._on_attitude,
            "ATTITUDE_QUATERNION": self._on_quaternion,
            "SCALED_IMU": self._on_milli_g,
            "HIGHRES_IMU": self._on_highres,
            "LOCAL_POSITION_NED": self._on_local,
            "VFR_HUD": self._on_hud,
            "GPS_RAW_INT": places.on_gps,
            "GLOBAL_POSITION_INT": places.on_global,
            "SYS_STATUS": power.on_system,
            "BATTERY_STATUS": power.on_battery,
            "STATUSTEXT": texts.on_text,
        }
        self.forget()

    def forget(self) -> None:
        """The vehicle was away: what it told before is not combined with what it tells now."""
        self._orientation: tuple[float, Wxyz] | None = None
        self._acceleration: tuple[float, tuple[float, float, float]] | None = None
        self._quaternion_s = -math.inf

    def take(self, message: Any) -> None:
        """Publish what it says, if it is one of those known here."""
        if taker := self._takers.get(message.get_type()):
            taker(message)

    # -- attitude --------------------------------------------------------------------------------------------------

    def _on_quaternion(self, message: Any) -> None:
        self._quaternion_s = self._context.clock.monotonic_s()
        self._publish_imu(orientation_of_quaternion(message.q1, message.q2, message.q3, message.q4), message)

    def _on_attitude(self, message: Any) -> None:
        if self._context.clock.monotonic_s() - self._quaternion_s > _FRESH_S:  # else it is the same attitude again
            self._publish_imu(orientation_of_euler(message.roll, message.pitch, message.yaw), message)

    def _publish_imu(self, orientation: Wxyz | None, message: Any) -> None:
        context = self._context
        rates = flu_of_frd(message.rollspeed, message.pitchspeed, message.yawspeed)
        if orientation is None or not all(map(math.isfinite, rates)):
            context.count("bad_values")
            return
        now_s, stamp_ns = context.clock.monotonic_s(), context.clock.wall_ns()
        self._orientation = (now_s, orientation)
        imu = Imu(header=Header(stamp=context.stamp(stamp_ns), frame_id=context["frame_id"]))
        imu.orientation = _quaternion(orientation)
        imu.angular_velocity = _vector(rates)
        known = self._acceleration
        if known is not None and now_s - known[0] <= _FRESH_S:
            imu.linear_acceleration = _vector(known[1])
        else:
            imu.linear_acceleration_covariance = np.array([-1.0, *[0.0] * 8])  # ROS: there is none
        self._imus.publish(imu, stamp_ns=stamp_ns)

    def _on_milli_g(self, message: Any) -> None:
        scale = _G / 1000
        self._note_acceleration(scale * message.xacc, scale * message.yacc, scale * message.zacc)

    def _on_highres(self, message: Any) -> None:
        self._note_acceleration(message.xacc, message.yacc, message.zacc)

    def _note_acceleration(self, x: float, y: float, z: float) -> None:
        if math.isfinite(x + y + z):
            self._acceleration = (self._context.clock.monotonic_s(), flu_of_frd(x, y, z))
        else:
            self._context.count("bad_values")

    # -- movement --------------------------------------------------------------------------------------------------

    def _on_local(self, message: Any) -> None:
        context, known = self._context, self._orientation
        place = enu_of_ned(message.x, message.y, message.z)
        velocity = enu_of_ned(message.vx, message.vy, message.vz)
        if not all(map(math.isfinite, (*place, *velocity))):
            context.count("bad_values")
            return
        if known is None or context.clock.monotonic_s() - known[0] > _FRESH_S:
            return  # which way it points is not known, and an odometry's speed is that of its body
        stamp_ns = context.clock.wall_ns()
        pose = Pose(position=Point(x=place[0], y=place[1], z=place[2]), orientation=_quaternion(known[1]))
        twist = Twist(linear=_vector(into_body(known[1], velocity)))
        odometry = Odometry(
            header=Header(stamp=context.stamp(stamp_ns), frame_id=context["odom_frame"]),
            child_frame_id=context["frame_id"],
            pose=PoseWithCovariance(pose=pose),
            twist=TwistWithCovariance(twist=twist),
        )
        self._odometry.publish(odometry, stamp_ns=stamp_ns)

    def _on_hud(self, message: Any) -> None:
        for name, publisher in self._hud.items():
            value = float(getattr(message, name))
            if math.isfinite(value):
                publisher.publish(Float64(data=value))


def _vector(values: tuple[float, float, float]) -> Vector3:
    return Vector3(x=values[0], y=values[1], z=values[2])


def _quaternion(wxyz: Wxyz) -> Quaternion:
    w, x, y, z = wxyz
    return Quaternion(x=x, y=y, z=z, w=w)
