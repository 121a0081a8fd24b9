"""`rclpy.impl.rcutils_logger`: loggers, to the terminal and to /rosout."""

from __future__ import annotations

import os
import sys
from types import CodeType, FrameType
from typing import Any, Final

from metaros.ros2.rclpy.logging.console import Record
from metaros.ros2.rclpy.logging.filters import Filters, wanted_filters
from metaros.ros2.rclpy.logging.levels import LEVELS, SEPARATOR
from metaros.ros2.rclpy.logging.rosout import ROSOUT
from metaros.ros2.rclpy.logging.severity import LoggingSeverity
from metaros.ros2.rclpy.logging.state import STATE

__all__ = ["RcutilsLogger"]

_DEBUG, _INFO, _WARN, _ERROR, _FATAL = (
    LoggingSeverity.DEBUG,
    LoggingSeverity.INFO,
    LoggingSeverity.WARN,
    LoggingSeverity.ERROR,
    LoggingSeverity.FATAL,
)
_internal_callers: Final[list[str]] = [__file__]  # rclpy's name: files whose frames are not where a message comes from


class RcutilsLogger:
    """Shows messages at or above its level; each method returns whether the message was shown.

    The keywords `throttle_duration_sec` (with `throttle_time_source_type`, a clock), `skip_first` and `once` go by the
    line of the program that calls: it may not change them, nor its severity, from call to call.
    """

    def __init__(self, name: str = "") -> None:
        self.name = name
        self.contexts: dict[tuple[CodeType, int], Filters] = {}  # by the line that calls
        self._of_node = ROSOUT.knows(name)
        self._is_child = False

    def __del__(self) -> None:
        if self._is_child:
            ROSOUT.remove_child(self.name)

    def get_child(self, name: str) -> RcutilsLogger:
        """The logger `name` below this one. Below a node's logger it publishes on /rosout, too.

        Raises:
            ValueError: the name is empty.
            RuntimeError: this is the logger of a node that is gone.
        """
        if not name:
            raise ValueError("Child logger name must not be empty.")
        if self._of_node and not ROSOUT.knows(self.name):
            raise RuntimeError(f"the node of the logger {self.name!r} is gone: it can have no children")
        is_child = bool(self.name) and ROSOUT.add_child(self.name, name)
        child = RcutilsLogger(f"{self.name}{SEPARATOR}{name}" if self.name else name)
        child._is_child = is_child
        return child

    def set_level(self, level: int) -> None:
        """Show messages from this level on; UNSET leaves it to the logger above."""
        LEVELS.set(self.name, LoggingSeverity(level))

    def get_effective_level(self) -> LoggingSeverity:
        """The level it goes by, its own or that of a logger above it."""
        return LEVELS.effective(self.name)

    def is_enabled_for(self, severity: int) -> bool:
        """Whether messages of this severity are shown."""
        return LoggingSeverity(severity) >= LEVELS.effective(self.name)

    def log(self, message: object, severity: int, **kwargs: Any) -> bool:
        """Show the message. `name=` has it said by another logger.

        Raises:
            TypeError: a keyword is none of the filters', or lacks its companion.
            ValueError: the line asked for something else before.
        """
        if severity < LEVELS.effective(self.name):
            return False
        grave = LoggingSeverity(severity)
        frame = sys._getframe(1)
        while frame.f_back is not None and _is_internal(frame):
            frame = frame.f_back
        name = kwargs.pop("name", self.name)
        wanted = wanted_filters(kwargs) if kwargs else ()
        code = frame.f_code
        line = (code, frame.f_lasti)
        filters = self.contexts.get(line)
        if filters is None:
            filters = self.contexts[line] = Filters(name, grave, wanted, kwargs)
        else:
            filters.check_same(name, grave, wanted, kwargs)
        if wanted and not filters.pass_on():
            return False
        stamp_ns = STATE.clock.wall_ns()
        file = os.path.abspath(code.co_filename)
        record = Record(grave.name, name, str(message), stamp_ns, code.co_name, file, frame.f_lineno)
        STATE.write(record)
        return True

    def debug(self, message: object, **kwargs: Any) -> bool:
        """For who looks for a fault."""
        return self.log(message, _DEBUG, **kwargs)

    def info(self, message: object, **kwargs: Any) -> bool:
        """What happens."""
        return self.log(message, _INFO, **kwargs)

    def warning(self, message: object, **kwargs: Any) -> bool:
        """What may become a fault."""
        return self.log(message, _WARN, **kwargs)

    def warn(self, message: object, **kwargs: Any) -> bool:
        """The old name of `warning`."""
        return self.log(message, _WARN, **kwargs)

    def error(self, message: object, **kwargs: Any) -> bool:
        """What failed."""
        return self.log(message, _ERROR, **kwargs)

    def fatal(self, message: object, **kwargs: Any) -> bool:
        """What ends the program."""
        return self.log(message, _FATAL, **kwargs)


def _is_internal(frame: FrameType) -> bool:
    file = frame.f_code.co_filename
    return any(part in file for part in _internal_callers)
