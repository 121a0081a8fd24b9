"""`rclpy.impl.logging_severity`: how grave a message is."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["LoggingSeverity"]


class LoggingSeverity(IntEnum):
    """A logger shows messages of its level and what is graver; UNSET goes by the logger above it."""

    UNSET = 0
    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50
