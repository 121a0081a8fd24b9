"""`rclpy.utilities`: the default context, and small helpers."""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from typing import Final

from metaros.node.arguments import without_ros_args
from metaros.ros2.rclpy.core.context import Context

__all__ = [
    "get_available_rmw_implementations",
    "get_default_context",
    "get_rmw_implementation_identifier",
    "ok",
    "remove_ros_args",
    "shutdown",
    "timeout_sec_to_nsec",
    "try_shutdown",
]

_RMW: Final = "rmw_zenoh_cpp"  # whose wire this library speaks
_S_TO_NS: Final = 1_000_000_000


class _Default:
    """The context of programs that name none."""

    def __init__(self) -> None:
        self.lock = threading.RLock()  # a program's handler of signals may ask in the middle of anything
        self.context: Context | None = None


_default = _Default()


def get_default_context(*, shutting_down: bool = False) -> Context:
    """The process's context, made on first use; `shutting_down` gives it out for the last time."""
    with _default.lock:
        context = _default.context or Context()
        _default.context = None if shutting_down else context
        return context


def ok(*, context: Context | None = None) -> bool:
    """Whether a context, or the default one, is initialised and not shut down."""
    return (get_default_context() if context is None else context).ok()


def shutdown(*, context: Context | None = None) -> None:
    """Shut a context down, or the default one; RuntimeError where there is nothing to shut down."""
    (get_default_context(shutting_down=True) if context is None else context).shutdown()


def try_shutdown(*, context: Context | None = None) -> None:
    """The same without the error."""
    (get_default_context(shutting_down=True) if context is None else context).try_shutdown()


def remove_ros_args(args: Sequence[str] | None = None) -> list[str]:
    """A command line, or the process's, without what stands after `--ros-args`; RuntimeError where it is empty."""
    if args is not None and not args:
        raise RuntimeError("the command line is empty: it begins with the program's name, as sys.argv does")
    return without_ros_args(sys.argv if args is None else args)


def get_rmw_implementation_identifier() -> str:
    """The middleware that ROS 2 programs see: they may ask for its name to know its limits."""
    return _RMW


def get_available_rmw_implementations() -> set[str]:
    """There is one."""
    return {_RMW}


def timeout_sec_to_nsec(timeout_sec: float | None) -> int:
    """Seconds as nanoseconds; -1, for ever, where there are none or less than none."""
    return -1 if timeout_sec is None or timeout_sec < 0 else int(float(timeout_sec) * _S_TO_NS)
