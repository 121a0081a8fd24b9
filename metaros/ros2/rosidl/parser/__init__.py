"""`rosidl_parser`: the descriptions of field types that `SLOT_TYPES` of message classes hold."""

from __future__ import annotations

from metaros.ros2.rosidl.parser import definition

__all__ = ["definition"]
