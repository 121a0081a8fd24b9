"""What judging 10,000 series costs: the detectors, everything that judges robots, and river's trees beside them.

What they find is `make bench-anomaly`.
"""

from __future__ import annotations

from load_tests.anomaly.speed import main

__all__ = ["main"]
