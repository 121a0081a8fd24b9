"""`rclpy.logging`: loggers by name, their levels, and where log files would go."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from metaros.ros2.rclpy.logging.levels import LEVELS
from metaros.ros2.rclpy.logging.rcutils_logger import RcutilsLogger
from metaros.ros2.rclpy.logging.rosout import ROSOUT
from metaros.ros2.rclpy.logging.severity import LoggingSeverity
from metaros.ros2.rclpy.logging.state import STATE

if TYPE_CHECKING:
    from pathlib import Path

__all__ = [
    "LoggingSeverity",
    "RcutilsLogger",
    "clear_config",
    "get_logger",
    "get_logger_effective_level",
    "get_logger_level",
    "get_logging_directory",
    "get_logging_severity_from_string",
    "initialize",
    "node_logger",
    "set_logger_level",
    "shutdown",
]

_root_logger = RcutilsLogger()  # rclpy's name of it


def get_logger(name: str) -> RcutilsLogger:
    """The logger of that name; `a.b` is below `a`. ValueError where the name is empty."""
    if not name:
        raise ValueError("Logger name must not be empty.")
    return _root_logger.get_child(name)


def node_logger(node: Any) -> RcutilsLogger:
    """The logger of a node of this library, under its name with dots; it publishes on /rosout where the node does."""
    ROSOUT.attach(node)
    return RcutilsLogger(node.get_logger().name)


def initialize() -> None:
    """Read the environment's RCUTILS_* anew at the next message; ValueError then, where it cannot be read."""
    STATE.console = None


def shutdown() -> None:
    """Forget all levels. Loggers stay usable."""
    LEVELS.clear()


def clear_config() -> None:
    """Forget all levels, and read the environment anew."""
    shutdown()
    initialize()


def set_logger_level(name: str, level: int, detailed_error: bool = False) -> None:
    """Set a logger's level; "" is the logger above all. ValueError for what is no level."""
    del detailed_error  # errors say here all they know
    LEVELS.set(name, LoggingSeverity(level))


def get_logger_level(name: str) -> LoggingSeverity:
    """The level that was set for this very logger, UNSET where none was."""
    return LEVELS.get(name)


def get_logger_effective_level(name: str) -> LoggingSeverity:
    """The level it goes by, its own or that of a logger above it."""
    return LEVELS.effective(name)


def get_logging_severity_from_string(log_severity: str) -> LoggingSeverity:
    """The severity of that name, in large or small letters; RuntimeError where there is none."""
    try:
        return LoggingSeverity[log_severity.upper()]
    except KeyError:
        known = ", ".join(LoggingSeverity.__members__)
        raise RuntimeError(f"{log_severity!r} is no severity: there are {known}") from None


def get_logging_directory() -> Path:
    """`ROS_LOG_DIR`, or `log` in `ROS_HOME`, which is `~/.ros`. This library writes no files there."""
    from pathlib import Path

    given = os.environ.get("ROS_LOG_DIR")
    home = os.environ.get("ROS_HOME") or str(Path("~") / ".ros")
    return Path(given).expanduser() if given else Path(home).expanduser() / "log"
