"""The body of one robot: a differential drive with two motors and a battery, stepped in fixed time steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from metaros.sim.power import Battery, Motor
from metaros.sim.world import Circle, World

__all__ = ["DRIVE", "Body", "Drive", "wrap_angle"]


@dataclass(frozen=True, slots=True)
class Drive:
    """What the machine is built like."""

    radius_m: float = 0.3
    track_m: float = 0.44  # between the wheels
    max_linear_m_s: float = 1.0
    max_angular_rad_s: float = 1.8
    accel_m_s2: float = 1.6
    brake_m_s2: float = 9.0  # full speed to standstill within 150 ms
    idle_w: float = 32.0  # computer, lidar, camera


DRIVE = Drive()


def wrap_angle(angle_rad: float) -> float:
    """The same angle within -pi..pi."""
    return math.remainder(angle_rad, math.tau)


def _approach(speed: float, goal: float, *, drive: Drive, dt_s: float) -> float:
    """Wheel speed after `dt_s`: speeding up is gentle, slowing down is not, and a reversal brakes first."""
    slowing = speed * goal < 0.0 or abs(goal) < abs(speed)
    step = (drive.brake_m_s2 if slowing else drive.accel_m_s2) * dt_s
    if speed * goal < 0.0:
        goal = 0.0
    return speed + min(max(goal - speed, -step), step)


class Body:
    """Pose, wheels, motors, battery. `step` advances all of them; nothing here is random."""

    def __init__(self, world: World, *, x: float, y: float, heading_rad: float, charge: float) -> None:
        self.world = world
        self.x, self.y, self.heading_rad = x, y, heading_rad
        self.left_m_s = self.right_m_s = 0.0
        self.accel_m_s2 = 0.0
        self.bumped = False
        self.battery = Battery(charge)
        self.motors = (Motor(), Motor())

    @property
    def linear_m_s(self) -> float:
        """Forward speed of the middle."""
        return (self.left_m_s + self.right_m_s) / 2

    @property
    def angular_rad_s(self) -> float:
        """Turning speed, positive to the left."""
        return (self.right_m_s - self.left_m_s) / DRIVE.track_m

    @property
    def motor_temperature_c(self) -> float:
        """Of the hotter motor."""
        return max(motor.temperature_c for motor in self.motors)

    def step(
        self,
        linear_m_s: float,
        angular_rad_s: float,
        *,
        dt_s: float,
        others: Sequence[Circle] = (),
        stuck_wheel: bool = False,
        extra_heat_c: float = 0.0,
    ) -> None:
        """Follow a speed command for `dt_s`. An empty battery turns the wheels off."""
        if self.battery.charge <= 0.0:
            linear_m_s = angular_rad_s = 0.0
        linear = min(max(linear_m_s, -DRIVE.max_linear_m_s), DRIVE.max_linear_m_s)
        angular = min(max(angular_rad_s, -DRIVE.max_angular_rad_s), DRIVE.max_angular_rad_s)
        aside = angular * DRIVE.track_m / 2
        before = (self.left_m_s, self.right_m_s, self.linear_m_s)
        self.left_m_s = 0.0 if stuck_wheel else _approach(self.left_m_s, linear - aside, drive=DRIVE, dt_s=dt_s)
        self.right_m_s = _approach(self.right_m_s, linear + aside, drive=DRIVE, dt_s=dt_s)
        self._move(dt_s, others)
        self.accel_m_s2 = (self.linear_m_s - before[2]) / dt_s
        stalled = stuck_wheel and abs(linear - aside) > 0.05
        speeds = ((self.left_m_s, before[0], stalled, extra_heat_c), (self.right_m_s, before[1], False, 0.0))
        for motor, (speed, old, stall, heat) in zip(self.motors, speeds, strict=True):
            motor.run(speed_m_s=speed, accel_m_s2=(speed - old) / dt_s, stalled=stall, extra_c=heat, dt_s=dt_s)
        self.battery.draw(DRIVE.idle_w + sum(motor.power_w for motor in self.motors), dt_s=dt_s)

    def _move(self, dt_s: float, others: Sequence[Circle]) -> None:
        """Drive the arc, then give way to what is solid: walls and racks push the disc out, robots stop it."""
        turn = self.angular_rad_s * dt_s
        middle = self.heading_rad + turn / 2
        x = self.x + self.linear_m_s * dt_s * math.cos(middle)
        y = self.y + self.linear_m_s * dt_s * math.sin(middle)
        self.heading_rad = wrap_angle(self.heading_rad + turn)
        x, y, self.bumped = self.world.push_out(x, y, DRIVE.radius_m)
        for other in others:
            reach = DRIVE.radius_m + other.radius_m
            now, then = math.hypot(other.x - self.x, other.y - self.y), math.hypot(other.x - x, other.y - y)
            if then < reach and then < now:
                self.bumped = True
                x, y = self.x, self.y
        if self.bumped:
            travelled = math.hypot(x - self.x, y - self.y) / dt_s
            scale = min(1.0, travelled / abs(self.linear_m_s)) if self.linear_m_s else 1.0
            spin = (self.right_m_s - self.left_m_s) / 2
            linear = self.linear_m_s * scale
            self.left_m_s, self.right_m_s = linear - spin, linear + spin
        self.x, self.y = x, y
