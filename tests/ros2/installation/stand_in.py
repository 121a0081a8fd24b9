"""A folder that looks like an installation of ROS 2 and leads to our rclpy face."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

__all__ = ["make_stand_in"]

ROOT = Path(__file__).parents[3]
COMMAND = Path(__file__).parents[1] / "programs" / "ros2_command.py"


def make_stand_in(folder: Path) -> Path:
    """Its setup.bash puts a `python3` and a `ros2` first on the path."""
    programs = folder / "bin"
    programs.mkdir(parents=True)
    (folder / "share" / "type_description_interfaces").mkdir(parents=True)  # as from ROS 2 Iron on
    run = f"exec {shlex.quote(sys.executable)} -m metaros.ros2"
    for name, line in (("python3", f'{run} "$@"'), ("ros2", f'{run} {shlex.quote(str(COMMAND))} "$@"')):
        (programs / name).write_text(f"#!/bin/bash\ncd {shlex.quote(str(ROOT))} && {line}\n")
        (programs / name).chmod(0o755)
    (folder / "setup.bash").write_text(f"export PATH={shlex.quote(str(programs))}:$PATH\n")
    return folder
