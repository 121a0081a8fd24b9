"""What all loggers of the process write to, and what command lines say of it."""

from __future__ import annotations

from typing import Final

from metaros.clock import SystemClock
from metaros.node.arguments import RosArguments
from metaros.ros2.rclpy.logging.console import Console, Record
from metaros.ros2.rclpy.logging.levels import LEVELS
from metaros.ros2.rclpy.logging.rosout import ROSOUT

__all__ = ["STATE", "configure"]


class _State:
    """The terminal, made of the environment at the first message, and /rosout."""

    def __init__(self) -> None:
        self.console: Console | None = None
        self.to_terminal = True
        self.clock = SystemClock()

    def write(self, record: Record) -> None:
        """To both."""
        if self.to_terminal:
            if self.console is None:
                self.console = Console()
            self.console.write(record)
        ROSOUT.publish(record)


STATE: Final = _State()


def configure(arguments: RosArguments) -> None:
    """Do what a command line says of logging: `--log-level`, `--disable-stdout-logs`."""
    LEVELS.configure(arguments.log_level, dict(arguments.log_levels))
    STATE.to_terminal = "stdout-logs" not in arguments.off
