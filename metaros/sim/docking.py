"""Docking at a charging pad: requested, on the way, charging, full.

The pads are at four corner crossings. A robot that docks drives to the nearest one along the streets, stands on it
until its battery is full, and then drives itself again. Whoever takes the robot over ends it. No I/O.
"""

from __future__ import annotations

import math
from enum import Enum

from metaros.sim.power import Battery
from metaros.sim.robot import Body
from metaros.sim.warehouse import CROSS_AISLES_X, CROSSINGS

__all__ = ["PADS", "PAD_M", "Dock", "Docking", "steps_between"]

_LAST = len(CROSSINGS) - 1
_WIDTH = len(CROSS_AISLES_X)
PADS = (0, _WIDTH - 1, _LAST - _WIDTH + 1, _LAST)  # crossings
PAD_M = 1.2  # how near its middle a robot charges
CHARGE_PER_S = 0.02


class Docking(Enum):
    """The state of docking."""

    AWAY = "away"
    SEEKING = "seeking"
    CHARGING = "charging"


class Dock:
    """One robot's docking."""

    def __init__(self) -> None:
        self.docking = Docking.AWAY
        self.pad = PADS[0]

    def seek(self, body: Body) -> str:
        """Begin; which way it goes, in words."""
        if self.docking is not Docking.AWAY:
            return f"the robot is {self.docking.value} already"
        self.pad = min(PADS, key=lambda pad: math.dist(CROSSINGS[pad], (body.x, body.y)))
        self.docking = Docking.SEEKING
        return "docking: on the way to the charging pad at ({:.1f}, {:.1f})".format(*CROSSINGS[self.pad])

    def leave(self) -> str | None:
        """Somebody else decides where the robot goes."""
        before, self.docking = self.docking, Docking.AWAY
        return None if before is Docking.AWAY else "docking given up"

    def onward(self, nodes: list[int]) -> int | None:
        """Which crossing comes next; None where the robot goes nowhere in particular."""
        if self.docking is not Docking.SEEKING:
            return None
        return min(nodes, key=lambda node: steps_between(node, self.pad))

    def step(self, body: Body, *, dt_s: float) -> str | None:
        """Arrive, charge, be full; a line for the log on a change."""
        if self.docking is Docking.SEEKING and math.dist(CROSSINGS[self.pad], (body.x, body.y)) < PAD_M:
            self.docking = Docking.CHARGING
            return f"docked: charging from {body.battery.charge:.0%}"
        if self.docking is not Docking.CHARGING:
            return None
        battery: Battery = body.battery
        battery.feed(CHARGE_PER_S, dt_s=dt_s)
        if battery.charge < 1.0:
            return None
        self.docking = Docking.AWAY
        return "charged: 100%"


def steps_between(node: int, other: int) -> int:
    """Crossings from one to another along the streets, which are a grid."""
    (row, column), (to_row, to_column) = divmod(node, _WIDTH), divmod(other, _WIDTH)
    return abs(row - to_row) + abs(column - to_column)
