"""What can be made to go wrong with a simulated robot, and when.

A fault is injected by name on the robot's fault topic, or by a schedule text `sim_2:stuck_wheel@30` (thirty seconds
after the start); `clear` ends all of a robot's faults.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from metaros.errors import ConfigError

__all__ = ["CLEAR", "FAULTS", "FaultKind", "ScheduledFault", "parse_schedule"]

CLEAR = "clear"


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One injectable fault and what an operator would see of it."""

    name: str
    effect: str


FAULTS: dict[str, FaultKind] = {
    kind.name: kind
    for kind in (
        FaultKind("stuck_wheel", "the left wheel blocks: the robot circles, its motor draws stall current and heats"),
        FaultKind("hot_motor", "the left motor heats far above what its load explains"),
        FaultKind("camera_freeze", "the camera repeats its last picture under fresh stamps"),
        FaultKind("lidar_dropout", "most laser rays return nothing and every second scan is missing"),
        FaultKind("lidar_slow", "the lidar turns slowly: two scans a second instead of ten"),
        FaultKind("battery_drain", "the charge falls by half a percent a second"),
    )
}

_SCHEDULE = re.compile(r"(?P<robot>[A-Za-z]\w*):(?P<fault>\w+)(?:@(?P<at>\d+(?:\.\d+)?))?")


@dataclass(frozen=True, slots=True)
class ScheduledFault:
    """A fault (or `clear`) that starts `at_s` seconds after the simulation."""

    robot: str
    fault: str
    at_s: float


def parse_schedule(text: str) -> ScheduledFault:
    """Read `ROBOT:FAULT@SECONDS`; without `@SECONDS` it is there from the start. Raises ConfigError."""
    match = _SCHEDULE.fullmatch(text.strip())
    if match is None:
        raise ConfigError(f"fault {text!r} is not of the form ROBOT:FAULT@SECONDS, such as sim_2:stuck_wheel@30")
    if match["fault"] not in FAULTS and match["fault"] != CLEAR:
        raise ConfigError(f"unknown fault {match['fault']!r}: one of {', '.join((*FAULTS, CLEAR))}")
    return ScheduledFault(match["robot"], match["fault"], float(match["at"] or 0.0))
