"""The errors that rclpy's C extension defines; some of `rclpy`'s own modules re-export them.

They derive from what rclpy's derive from, so that `except RuntimeError` and `except ValueError` go on meaning the same.
"""

from __future__ import annotations

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


class InvalidHandle(RuntimeError):
    """The object behind a handle was destroyed: what was made on the node is no more usable."""


class RCLError(RuntimeError):
    """The middleware refused, or could not do it."""


class RCLInvalidROSArgsError(RCLError):
    """What stands after `--ros-args` cannot be read."""


class UnknownROSArgsError(RuntimeError):
    """A word after `--ros-args` that nobody knows."""


class NodeNameNonExistentError(RCLError):
    """No node of that name is in the graph."""


class UnsupportedError(RCLError):
    """The middleware cannot do this: content filters, loaned messages."""


class UnsupportedEventTypeError(RCLError):
    """The middleware does not report events of this kind."""


class TimerCancelledError(RCLError):
    """The timer was cancelled, and has no next call."""


class RMWError(RuntimeError):
    """The middleware below refused."""
