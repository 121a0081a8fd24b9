"""What every kind of buffer has: looking up, and transforming objects by what was looked up."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_ros.registrations import (
    ConvertRegistration,
    NotImplementedException,
    TransformRegistration,
    TypeException,
    convert,
)

__all__ = [
    "BufferInterface",
    "ConvertRegistration",
    "NotImplementedException",
    "Stamped",
    "TransformRegistration",
    "TypeException",
    "convert",
]


class BufferInterface:
    """Buffers derive from this and say how to look up. A timeout is an `rclpy.duration.Duration`; None for none."""

    def __init__(self) -> None:
        self.registration = TransformRegistration()

    def transform(self, object_stamped: Any, target_frame: str, timeout: Any = None, new_type: Any = None) -> Any:
        """The object in another frame, at its own time; as `new_type` if that is given.

        Raises:
            TypeException: no package that was imported knows the type.
            TransformException: as `lookup_transform`.
        """
        do_transform = self.registration.get(type(object_stamped))
        header = object_stamped.header
        found = self.lookup_transform(target_frame, header.frame_id, header.stamp, timeout)
        return _as_type(do_transform(object_stamped, found), new_type)

    def transform_full(
        self,
        object_stamped: Any,
        target_frame: str,
        target_time: Any,
        fixed_frame: str,
        timeout: Any = None,
        new_type: Any = None,
    ) -> Any:
        """The same at another time, by way of a frame that does not move in between."""
        do_transform = self.registration.get(type(object_stamped))
        header = object_stamped.header
        found = self.lookup_transform_full(
            target_frame, target_time, header.frame_id, header.stamp, fixed_frame, timeout
        )
        return _as_type(do_transform(object_stamped, found), new_type)

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any = None) -> Any:
        """The `TransformStamped` from source to target."""
        raise NotImplementedException

    def lookup_transform_full(
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = None,
    ) -> Any:
        """The same between two times."""
        raise NotImplementedException

    def can_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any = None) -> Any:
        """Whether `lookup_transform` would answer."""
        raise NotImplementedException

    def can_transform_full(
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = None,
    ) -> Any:
        """Whether `lookup_transform_full` would answer."""
        raise NotImplementedException


def Stamped(obj: Any, stamp: Any, frame_id: str) -> Any:
    """The object itself, with a header of that time and frame."""
    obj.header = interface("std_msgs/msg/Header")(frame_id=frame_id, stamp=stamp)
    return obj


def _as_type(found: Any, new_type: Any) -> Any:
    return found if new_type is None else convert(found, new_type)
