"""`python -m metaros.robot_functions.bundle`."""

from __future__ import annotations

import sys

from metaros.automation.robot.bundle import main

__all__ = ["main"]

if __name__ == "__main__":
    sys.exit(main())
