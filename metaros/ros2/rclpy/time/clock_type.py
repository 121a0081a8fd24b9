"""`rclpy.clock_type`: what a clock shows, and how its source may change."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["ClockChange", "ClockType"]


class ClockType(IntEnum):
    """What a clock, or a time of it, counts from."""

    UNINITIALIZED = 0
    ROS_TIME = 1  # the system's, or a simulation's where one is followed
    SYSTEM_TIME = 2  # since the Unix epoch; jumps when somebody sets it
    STEADY_TIME = 3  # since some start; never goes back


class ClockChange(IntEnum):
    """What happened to a clock at a jump."""

    ROS_TIME_NO_CHANGE = 1
    ROS_TIME_ACTIVATED = 2
    ROS_TIME_DEACTIVATED = 3
    SYSTEM_TIME_NO_CHANGE = 4
