"""The messages of nav_msgs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.geometry_msgs import msg as geometry_msgs_msg
from metaros.interfaces.std_msgs import msg as std_msgs_msg

class Goals(Message):
    header: std_msgs_msg.Header
    goals: list[geometry_msgs_msg.PoseStamped]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        goals: list[geometry_msgs_msg.PoseStamped] = ...,
    ) -> None: ...

class GridCells(Message):
    header: std_msgs_msg.Header
    cell_width: float
    cell_height: float
    cells: list[geometry_msgs_msg.Point]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        cell_width: float = ...,
        cell_height: float = ...,
        cells: list[geometry_msgs_msg.Point] = ...,
    ) -> None: ...

class MapMetaData(Message):
    map_load_time: builtin_interfaces_msg.Time
    resolution: float
    width: int
    height: int
    origin: geometry_msgs_msg.Pose
    def __init__(
        self,
        *,
        map_load_time: builtin_interfaces_msg.Time = ...,
        resolution: float = ...,
        width: int = ...,
        height: int = ...,
        origin: geometry_msgs_msg.Pose = ...,
    ) -> None: ...

class OccupancyGrid(Message):
    header: std_msgs_msg.Header
    info: MapMetaData
    data: npt.NDArray[np.int8]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        info: MapMetaData = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class Odometry(Message):
    header: std_msgs_msg.Header
    child_frame_id: str
    pose: geometry_msgs_msg.PoseWithCovariance
    twist: geometry_msgs_msg.TwistWithCovariance
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        child_frame_id: str = ...,
        pose: geometry_msgs_msg.PoseWithCovariance = ...,
        twist: geometry_msgs_msg.TwistWithCovariance = ...,
    ) -> None: ...

class Path(Message):
    header: std_msgs_msg.Header
    poses: list[geometry_msgs_msg.PoseStamped]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        poses: list[geometry_msgs_msg.PoseStamped] = ...,
    ) -> None: ...

class Trajectory(Message):
    header: std_msgs_msg.Header
    points: list[TrajectoryPoint]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        points: list[TrajectoryPoint] = ...,
    ) -> None: ...

class TrajectoryPoint(Message):
    header: std_msgs_msg.Header
    pose: geometry_msgs_msg.Pose
    velocity: geometry_msgs_msg.Twist
    acceleration: geometry_msgs_msg.Accel
    effort: geometry_msgs_msg.Wrench
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        pose: geometry_msgs_msg.Pose = ...,
        velocity: geometry_msgs_msg.Twist = ...,
        acceleration: geometry_msgs_msg.Accel = ...,
        effort: geometry_msgs_msg.Wrench = ...,
    ) -> None: ...
