"""The messages of trajectory_msgs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.geometry_msgs import msg as geometry_msgs_msg
from metaros.interfaces.std_msgs import msg as std_msgs_msg

class JointTrajectory(Message):
    header: std_msgs_msg.Header
    joint_names: list[str]
    points: list[JointTrajectoryPoint]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        joint_names: list[str] = ...,
        points: list[JointTrajectoryPoint] = ...,
    ) -> None: ...

class JointTrajectoryPoint(Message):
    positions: npt.NDArray[np.float64]
    velocities: npt.NDArray[np.float64]
    accelerations: npt.NDArray[np.float64]
    effort: npt.NDArray[np.float64]
    time_from_start: builtin_interfaces_msg.Duration
    def __init__(
        self,
        *,
        positions: npt.NDArray[Any] | Sequence[float] = ...,
        velocities: npt.NDArray[Any] | Sequence[float] = ...,
        accelerations: npt.NDArray[Any] | Sequence[float] = ...,
        effort: npt.NDArray[Any] | Sequence[float] = ...,
        time_from_start: builtin_interfaces_msg.Duration = ...,
    ) -> None: ...

class MultiDOFJointTrajectory(Message):
    header: std_msgs_msg.Header
    joint_names: list[str]
    points: list[MultiDOFJointTrajectoryPoint]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        joint_names: list[str] = ...,
        points: list[MultiDOFJointTrajectoryPoint] = ...,
    ) -> None: ...

class MultiDOFJointTrajectoryPoint(Message):
    transforms: list[geometry_msgs_msg.Transform]
    velocities: list[geometry_msgs_msg.Twist]
    accelerations: list[geometry_msgs_msg.Twist]
    time_from_start: builtin_interfaces_msg.Duration
    def __init__(
        self,
        *,
        transforms: list[geometry_msgs_msg.Transform] = ...,
        velocities: list[geometry_msgs_msg.Twist] = ...,
        accelerations: list[geometry_msgs_msg.Twist] = ...,
        time_from_start: builtin_interfaces_msg.Duration = ...,
    ) -> None: ...
