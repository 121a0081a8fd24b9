"""Simulated robots in a small warehouse: the demo, and everybody's test rig.

`Fleet` is the pure simulation (no ROS, no clock of its own); `run_sim` puts it on the wire.
"""

from __future__ import annotations

from metaros.sim.faults import ScheduledFault, parse_schedule
from metaros.sim.main import run_sim

__all__ = ["ScheduledFault", "parse_schedule", "run_sim"]
