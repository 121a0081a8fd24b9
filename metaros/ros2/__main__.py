"""`python -m metaros.ros2 FILE|MODULE|PACKAGE EXECUTABLE [args] [--ros-args …]`: run a program written for ROS 2."""

from __future__ import annotations

import os
import sys

from metaros.errors import MetarosError

__all__ = ["main"]


def main() -> None:
    """Run it; 2 where there is no such program, else its own exit code."""
    from metaros.ros2.programs import find_program, run_program

    try:
        program, rest = find_program(sys.argv[1:])
    except MetarosError as error:
        sys.stderr.write(f"error: {error}\n")
        sys.exit(2)
    if sys.path[:1] == [os.getcwd()]:
        del sys.path[0]  # `-m` put it there: the program's own folder comes in its place
    run_program(program, rest, say=lambda note: sys.stderr.write(f"note: {note}\n"))


if __name__ == "__main__":
    main()
