"""The classes that ROS 2 programs know: one a type, of rosidl's shape."""

from __future__ import annotations

from typing import Any

from metaros.idl import message_class

__all__ = ["interface"]


def interface(name: str) -> type[Any]:
    """The class of "std_msgs/msg/String", "std_srvs/srv/Trigger" or "example_interfaces/action/Fibonacci"."""
    return message_class(name)
