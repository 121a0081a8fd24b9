"""`tf2_ros`: buffers of transforms for nodes, what fills them, and what tells transforms."""

from __future__ import annotations

from metaros.ros2.tf2_py import (
    BufferCore,
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TimeoutException,
    TransformException,
)
from metaros.ros2.tf2_ros.buffer import Buffer
from metaros.ros2.tf2_ros.buffer_client import BufferClient
from metaros.ros2.tf2_ros.buffer_interface import (
    BufferInterface,
    ConvertRegistration,
    NotImplementedException,
    Stamped,
    TransformRegistration,
    TypeException,
    convert,
)
from metaros.ros2.tf2_ros.static_transform_broadcaster import StaticTransformBroadcaster
from metaros.ros2.tf2_ros.static_transform_listener import StaticTransformListener
from metaros.ros2.tf2_ros.transform_broadcaster import TransformBroadcaster
from metaros.ros2.tf2_ros.transform_listener import TransformListener

__all__ = [
    "Buffer",
    "BufferClient",
    "BufferCore",
    "BufferInterface",
    "ConnectivityException",
    "ConvertRegistration",
    "ExtrapolationException",
    "InvalidArgumentException",
    "LookupException",
    "NotImplementedException",
    "Stamped",
    "StaticTransformBroadcaster",
    "StaticTransformListener",
    "TimeoutException",
    "TransformBroadcaster",
    "TransformException",
    "TransformListener",
    "TransformRegistration",
    "TypeException",
    "convert",
]
