"""How simulated robots spend their days, many at once: driving, turning, waiting, loading, charging, nights.

Arrays have a place a robot. A robot drives legs of some seconds with curves and slopes, waits and turns between them,
carries a load on some, goes to its charger when the battery is low and at night. The second is cut into steps in
which the wheels follow their speeds with limited acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gateway.alerting.anomaly.detectors.columns import Bools, Floats

__all__ = ["DAY_S", "Motion", "Motions"]

DAY_S = 86_400.0
DRIVE, TURN, WAIT, DOCK = range(4)
TRACK_M = 0.44
SPEED_UP, SLOW_DOWN = 1.6, 3.0


@dataclass(frozen=True, slots=True)
class Motion:
    """One second: wheel speeds and accelerations (steps, robots), commands, and what the ground is like."""

    left: Floats
    right: Floats
    left_accel: Floats
    right_accel: Floats
    linear_command: Floats
    angular_command: Floats
    slope: Floats
    loaded: Bools
    docked: Bools


class Motions:
    """The plans of all robots; `stuck` names those whose left wheel is blocked."""

    def __init__(self, robots: int, *, steps: int, rng: np.random.Generator) -> None:
        self._rng, self._steps = rng, steps
        self.robots = robots
        self._mode = np.full(robots, WAIT)
        self._left_s = rng.uniform(0.0, 20.0, robots)
        self._goal = np.zeros((2, robots))
        self._speed = np.zeros((2, robots))  # of the left and the right wheel
        self._slope = np.zeros(robots)
        self._cruise = rng.uniform(0.55, 0.95, robots)
        self._night = rng.uniform(19.5, 23.0, robots) * 3600.0
        self._morning = rng.uniform(5.0, 7.5, robots) * 3600.0
        self._low = rng.uniform(0.27, 0.36, robots)
        self._full = rng.uniform(0.85, 0.95, robots)
        self.loaded = rng.random(robots) < 0.4
        self.stuck = np.zeros(robots, np.bool_)
        self.homing = np.zeros(robots, np.bool_)  # on the way to the charger

    @property
    def driving(self) -> Bools:
        """Which are on a leg or turn."""
        found: Bools = self._mode <= TURN
        return found

    @property
    def docked(self) -> Bools:
        """Which are on their charger."""
        found: Bools = self._mode == DOCK
        return found

    def second(self, charge: Floats, clock_s: Floats, at_dock: Bools) -> Motion:
        """The next second, at each robot's local time of the day; `at_dock` are before their chargers."""
        self._left_s -= 1.0
        asleep = (clock_s > self._night) | (clock_s < self._morning)
        leaving = self.docked & ~asleep & (charge >= self._full)
        arrived = self.homing & at_dock & ~self.docked
        over = np.flatnonzero(((self._left_s <= 0.0) & ~self.docked) | leaving | arrived)
        for robot in over.tolist():
            self.homing[robot] = asleep[robot] or charge[robot] < self._low[robot]
            self._plan(robot, dock=bool(self.homing[robot] and at_dock[robot]))
        return self._drive()

    def _plan(self, robot: int, *, dock: bool) -> None:
        """What the robot does next."""
        rng, before = self._rng, self._mode[robot]
        if dock:
            mode, seconds, linear, angular = DOCK, 0.0, 0.0, 0.0
        elif before == DRIVE and rng.random() < 0.45:
            mode, linear, angular = WAIT, 0.0, 0.0
            seconds = rng.exponential(8.0) + 1.0 if rng.random() < 0.9 else rng.uniform(40.0, 240.0)
            if rng.random() < 0.3:
                self.loaded[robot] = not self.loaded[robot]
        elif before == DRIVE:
            mode, seconds = TURN, rng.uniform(0.8, 3.5)
            linear, angular = rng.uniform(0.0, 0.25), rng.choice((-1.0, 1.0)) * rng.uniform(0.4, 1.5)
        else:
            mode, seconds = DRIVE, 4.0 + rng.exponential(12.0)
            linear = self._cruise[robot] * rng.choice((1.0, 1.0, 0.8, 0.5))
            angular = rng.normal(0.0, 0.12)
            self._slope[robot] = rng.normal(0.0, 0.04) if rng.random() < 0.3 else 0.0
        self._mode[robot], self._left_s[robot] = mode, seconds
        self._goal[:, robot] = linear - angular * TRACK_M / 2, linear + angular * TRACK_M / 2

    def _drive(self) -> Motion:
        """The wheels of the second; a blocked one stands."""
        steps, dt_s = self._steps, 1.0 / self._steps
        speed, accel = np.empty((steps, 2, self.robots)), np.empty((steps, 2, self.robots))
        goal, now = self._goal, self._speed
        for step in range(steps):
            apart = goal - now
            slowing = np.abs(goal) < np.abs(now)
            reach = np.where(slowing, SLOW_DOWN, SPEED_UP) * dt_s
            change = np.clip(apart, -reach, reach)
            change[0] = np.where(self.stuck, -now[0], change[0])
            now = now + change
            speed[step], accel[step] = now, change / dt_s
        self._speed = now
        linear, angular = (goal[0] + goal[1]) / 2, (goal[1] - goal[0]) / TRACK_M
        moving = np.abs(now).sum(axis=0) > 0.0
        slope = np.where(moving, self._slope, 0.0)
        return Motion(
            speed[:, 0], speed[:, 1], accel[:, 0], accel[:, 1], linear, angular, slope, self.loaded.copy(), self.docked
        )
