"""A robot that drives itself: along the right-hand lane from crossing to crossing, stopping for what its laser sees.

It knows the street map and its own scan, nothing else; other robots are obstacles like any other. Chance comes from
the generator it is given, so that a seed fixes every trip.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from metaros.sim.robot import DRIVE, Body, wrap_angle
from metaros.sim.warehouse import CROSSINGS, NEIGHBOURS
from metaros.sim.world import Floats, World

__all__ = ["Autopilot"]

_LANE_M = 0.5  # right of the aisle's middle
_AHEAD_M = 0.9  # the point on the lane that is steered for
_TURN_OFF_M = 0.6  # before a crossing's middle
_TURN_ON_SPOT_RAD = 1.0
_STOP_GAP_M = 0.3
_SEEN_AHEAD_M = 2.0
_HALF_WIDTH_M = DRIVE.radius_m + 0.06
_CREEP_M_S = 0.12
_CREEP_S = 4.0
_POOR_SIGHT = 0.5  # part of the rays without return from which on it goes slowly


@dataclass(frozen=True, slots=True)
class _Leg:
    """One straight drive to a crossing, offset to the right of the line by `lane_m`."""

    from_x: float
    from_y: float
    to: int
    back_to: int | None
    lane_m: float


class Autopilot:
    """Decides (linear, angular) from pose and scan; `said` collects lines for the log."""

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        self.said: list[tuple[str, str]] = []
        self.cruise_m_s = float(rng.uniform(0.55, 0.75))
        self._world = world
        self._rng = rng
        self._leg: _Leg | None = None
        self._blocked_since: float | None = None
        self._patience_s = 3.0
        self._creep_until = -math.inf
        self._turned_back_at: tuple[float, float] | None = None
        self._gap: tuple[Floats, float] | None = None  # of which scan
        self.onward: Callable[[list[int]], int | None] = lambda nodes: None  # where somebody wants it to go

    def forget_route(self) -> None:
        """Somebody else drove: plan anew from wherever the robot is."""
        self._leg = None
        self._blocked_since = None

    def steer(self, body: Body, points: Floats, *, sight: float, now_s: float) -> tuple[float, float]:
        """Speeds to drive at: `points` is the last scan as (2, n) in the robot's frame, `sight` what returned."""
        leg = self._leg or self._nearest_leg(body)
        leg = self._next_leg(leg, body)
        self._leg = leg
        error = self._bearing(leg, body)
        angular = min(max(2.4 * error, -DRIVE.max_angular_rad_s), DRIVE.max_angular_rad_s)
        if abs(error) > _TURN_ON_SPOT_RAD:
            self._blocked_since = None
            return 0.0, angular
        cruise = self.cruise_m_s * (0.4 if sight < _POOR_SIGHT else 1.0)
        wanted = cruise * math.cos(error) ** 2
        if self._gap is None or self._gap[0] is not points:  # a scan is steered by for several steps
            self._gap = (points, self._gap_ahead(points))
        gap = self._gap[1]
        allowed = max(0.0, 1.1 * (gap - _STOP_GAP_M))
        if now_s < self._creep_until:
            return max(min(wanted, allowed), _CREEP_M_S), angular
        if allowed < 0.05:
            self._wait(leg, body, gap, now_s)
            return 0.0, angular
        self._blocked_since = None
        return min(wanted, allowed), angular

    def _wait(self, leg: _Leg, body: Body, gap_m: float, now_s: float) -> None:
        """Stand before an obstacle; after a while turn back, and if that did not help either, creep."""
        if self._blocked_since is None:
            self._blocked_since = now_s
            self._patience_s = float(self._rng.uniform(2.0, 5.0))
            self.said.append(("info", f"collision avoided: obstacle {gap_m:.2f} m ahead, waiting"))
            return
        if now_s - self._blocked_since < self._patience_s:
            return
        self._blocked_since = None
        here = (body.x, body.y)
        if leg.back_to is None or (self._turned_back_at and math.dist(here, self._turned_back_at) < 0.5):
            self._turned_back_at = None
            self._creep_until = now_s + _CREEP_S
            self.said.append(("warn", "blocked on both sides: creeping on"))
            return
        self._turned_back_at = here
        self.said.append(("info", f"way blocked for {self._patience_s:.1f} s: turning back"))
        self._leg = _Leg(*CROSSINGS[leg.to], leg.back_to, leg.to, _LANE_M)

    def _nearest_leg(self, body: Body) -> _Leg:
        """Straight to the nearest crossing in sight; a choice of equally near ones is settled by the table's order."""
        by_distance = sorted(range(len(CROSSINGS)), key=lambda node: math.dist(CROSSINGS[node], (body.x, body.y)))
        seen = (node for node in by_distance if self._world.sees(body.x, body.y, *CROSSINGS[node]))
        return _Leg(body.x, body.y, next(seen, by_distance[0]), None, 0.0)

    def _next_leg(self, leg: _Leg, body: Body) -> _Leg:
        """The leg to follow: another one when the present one's crossing is reached."""
        to_x, to_y = CROSSINGS[leg.to]
        length = math.hypot(to_x - leg.from_x, to_y - leg.from_y)
        if length > 1e-6:
            along = ((body.x - leg.from_x) * (to_x - leg.from_x) + (body.y - leg.from_y) * (to_y - leg.from_y)) / length
            if along < length - _TURN_OFF_M:
                return leg
        onward = [node for node in NEIGHBOURS[leg.to] if node != leg.back_to]
        wanted = self.onward(onward)
        chosen = onward[int(self._rng.integers(len(onward)))] if wanted is None else wanted
        return _Leg(to_x, to_y, chosen, leg.to, _LANE_M)

    def _bearing(self, leg: _Leg, body: Body) -> float:
        """Angle from the robot's heading to the point it steers for."""
        to_x, to_y = CROSSINGS[leg.to]
        length = max(math.hypot(to_x - leg.from_x, to_y - leg.from_y), 1e-6)
        ux, uy = (to_x - leg.from_x) / length, (to_y - leg.from_y) / length
        along = (body.x - leg.from_x) * ux + (body.y - leg.from_y) * uy + _AHEAD_M
        goal_x = leg.from_x + ux * along + uy * leg.lane_m
        goal_y = leg.from_y + uy * along - ux * leg.lane_m
        return wrap_angle(math.atan2(goal_y - body.y, goal_x - body.x) - body.heading_rad)

    @staticmethod
    def _gap_ahead(points: Floats) -> float:
        """Free metres before the bumper in the strip the robot needs."""
        ahead = points[0][(np.abs(points[1]) < _HALF_WIDTH_M) & (points[0] > 0.0)]
        return float(ahead.min()) - DRIVE.radius_m if len(ahead) else _SEEN_AHEAD_M
