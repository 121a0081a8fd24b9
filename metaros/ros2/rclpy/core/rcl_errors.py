"""The errors that rclpy's C extension defines; some of `rclpy`'s own modules re-export them.

They derive from what rclpy's derive from, so that `except RuntimeError` goes on meaning the same, and from this
library's errors where these mean the same.
"""

from __future__ import annotations

from collections.abc import Sequence

from metaros.errors import ClosedError, ConfigError, UnavailableError

__all__ = [
    "InvalidHandle",
    "NodeNameNonExistentError",
    "RCLError",
    "RCLInvalidROSArgsError",
    "RMWError",
    "TimerCancelledError",
    "UnknownROSArgsError",
    "UnsupportedError",
    "UnsupportedEventTypeError",
]


class InvalidHandle(ClosedError, RuntimeError):
    """The object behind a handle was destroyed: what was made on the node is no more usable."""


class RCLError(RuntimeError):
    """The middleware refused, or could not do it."""


class RCLInvalidROSArgsError(RCLError, ConfigError):
    """What stands after `--ros-args` cannot be read."""


class UnknownROSArgsError(ConfigError, RuntimeError):
    """There are words after `--ros-args` that nobody knows."""

    def __init__(self, unknown: Sequence[str] = ()) -> None:
        super().__init__(f"found unknown ROS arguments: {list(unknown)}")
        self.unknown_ros_args = list(unknown)


class NodeNameNonExistentError(RCLError, UnavailableError):
    """No node of that name is in the graph."""


class UnsupportedError(RCLError):
    """The middleware cannot do this: content filters, loaned messages."""


class UnsupportedEventTypeError(RCLError):
    """The middleware does not report events of this kind."""


class TimerCancelledError(RCLError):
    """The timer was cancelled, and has no next call."""


class RMWError(RuntimeError):
    """The middleware below refused."""
