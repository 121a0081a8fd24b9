"""`tf2_py`: the tree of frames by itself, without a node."""

from __future__ import annotations

from metaros.ros2.tf2_py.buffer_core import BufferCore
from metaros.ros2.tf2_py.exceptions import (
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TimeoutException,
    TransformException,
)

__all__ = [
    "BufferCore",
    "ConnectivityException",
    "ExtrapolationException",
    "InvalidArgumentException",
    "LookupException",
    "TimeoutException",
    "TransformException",
]
