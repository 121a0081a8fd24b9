"""`python -m metaros.robot_functions`."""

from __future__ import annotations

import sys

from metaros.automation.robot.program import main

if __name__ == "__main__":
    sys.exit(main())
