"""Programs written for ROS 2, run in this process as they are."""

from __future__ import annotations

from metaros.ros2.programs.lookup import Executable, executables, find_program
from metaros.ros2.programs.run import Program, run_program

__all__ = ["Executable", "Program", "executables", "find_program", "run_program"]
