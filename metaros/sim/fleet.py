"""N robots in one warehouse, in fixed time steps: the whole simulation without a clock, a thread or a message.

The same seed, step times and commands give the same states, bit for bit. Each robot has a generator of its own, so
that the number of robots or a missing camera does not change anybody's luck.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from metaros.errors import ConfigError
from metaros.sim.autopilot import Autopilot
from metaros.sim.command_gate import CommandGate, Mode
from metaros.sim.docking import Dock, Docking
from metaros.sim.faults import CLEAR, FAULTS, ScheduledFault
from metaros.sim.robot import DRIVE, Body
from metaros.sim.sensors import LIDAR, Imu, Lidar, Odometry
from metaros.sim.warehouse import WAREHOUSE, start_places
from metaros.sim.world import Circle

__all__ = ["RATE_HZ", "STEP_S", "Event", "Fleet", "SimRobot", "due"]

RATE_HZ = 50
STEP_S = 1.0 / RATE_HZ
_LOW_CHARGE = 0.15
_SWAP_AFTER_S = 30.0
_KEPT_EVENTS = 256  # of a robot whose events nobody drains; the oldest go


@dataclass(frozen=True, slots=True)
class Event:
    """Something worth a log line: `level` is info, warn or error."""

    level: str
    text: str


def due(rate_hz: float, tick: int) -> bool:
    """Whether something of `rate_hz` happens at a step: exactly that often a second, as evenly as steps allow."""
    return math.floor((tick + 1) * rate_hz / RATE_HZ) > math.floor(tick * rate_hz / RATE_HZ)


class SimRobot:
    """One robot: body, sensors, who drives, what is broken. `events` are drained by the reader.

    `max_speed_m_s` (of whoever drives), `drain_per_s` (of the battery, beside what is used) and `scan_rate_hz` may be
    changed at any time.
    """

    def __init__(
        self, number: int, *, place: tuple[float, float], rng: np.random.Generator, resume_after_s: float
    ) -> None:
        motion, senses = rng.spawn(2)
        heading = float(motion.uniform(-math.pi, math.pi))
        self.number = number
        self.name = f"sim_{number}"
        charge = float(motion.uniform(0.6, 0.98))
        self.body = Body(WAREHOUSE, x=place[0], y=place[1], heading_rad=heading, charge=charge)
        self.gate = CommandGate(resume_after_s=resume_after_s)
        self.autopilot = Autopilot(WAREHOUSE, motion)
        self.dock = Dock()
        self.autopilot.onward = self.dock.onward
        self.odometry = Odometry(self.body, senses)
        self.lidar = Lidar(senses)
        self.imu = Imu(self.body, senses)
        self.faults: set[str] = set()
        self.max_speed_m_s = DRIVE.max_linear_m_s
        self.drain_per_s = 0.0
        self.scan_rate_hz = LIDAR.rate_hz
        self.events: deque[Event] = deque(maxlen=_KEPT_EVENTS)
        self.scanned = False
        self._low = False
        self._empty_s = 0.0

    def circle(self) -> Circle:
        """What other robots meet."""
        return Circle(self.body.x, self.body.y, DRIVE.radius_m)

    def command(self, linear_m_s: float, angular_rad_s: float, *, now_s: float) -> None:
        """A `cmd_vel` arrived."""
        self._say("warn", self.gate.command(linear_m_s, angular_rad_s, now_s=now_s))
        self._say("warn", self.dock.leave())

    def seek_dock(self) -> tuple[bool, str]:
        """`~/dock` was called."""
        if self.gate.mode is Mode.COMMANDED:
            return False, "cmd_vel is driving the robot; stop sending commands first"
        if self.gate.mode is Mode.STANDING:
            self.resume()
        line = self.dock.seek(self.body)
        self._say("info", line)
        return True, line

    def resume(self) -> tuple[bool, str]:
        """`~/resume` was called."""
        before = self.gate.mode
        self._say("info", self.dock.leave())
        done, why = self.gate.resume()
        if before is not self.gate.mode:
            self._back_to_autonomy(why)
        return done, why

    def inject(self, fault: str) -> None:
        """Start a fault, or end all with `clear`. An unknown name is an event, nothing else."""
        if fault == CLEAR:
            self._say("info", f"faults cleared: {', '.join(sorted(self.faults)) or 'there were none'}")
            self.faults.clear()
        elif fault in FAULTS:
            self.faults.add(fault)
            self._say("error", f"fault {fault}: {FAULTS[fault].effect}")
        else:
            self._say("warn", f"unknown fault {fault[:40]!r}: one of {', '.join((*FAULTS, CLEAR))}")

    def step(self, tick: int, others: tuple[Circle, ...], *, now_s: float) -> None:
        """One time step: decide, move, sense."""
        before = self.gate.mode
        line = self.gate.poll(now_s=now_s)
        if line is not None and self.gate.mode is Mode.AUTONOMOUS and before is not Mode.AUTONOMOUS:
            self._back_to_autonomy(line)
        else:
            self._say("warn", line)
        target = self.gate.target()
        if target is None and self.dock.docking is Docking.CHARGING:
            target = (0.0, 0.0)
        if target is None:
            target = self.autopilot.steer(self.body, self.lidar.points, sight=self.lidar.sight, now_s=tick * STEP_S)
        linear, angular = target
        self.body.step(
            min(max(linear, -self.max_speed_m_s), self.max_speed_m_s),
            angular,
            dt_s=STEP_S,
            others=others,
            stuck_wheel="stuck_wheel" in self.faults,
            extra_heat_c=60.0 if "hot_motor" in self.faults else 0.0,
        )
        self.odometry.step(self.body, dt_s=STEP_S)
        self._say("info", self.dock.step(self.body, dt_s=STEP_S))
        self._watch_battery()
        scan_hz = min(LIDAR.slow_hz, self.scan_rate_hz) if "lidar_slow" in self.faults else self.scan_rate_hz
        self.scanned = due(scan_hz, tick) and self.lidar.scan(self.body, others, dropout="lidar_dropout" in self.faults)
        for level, text in self.autopilot.said:
            self._say(level, text)
        self.autopilot.said.clear()

    def _watch_battery(self) -> None:
        battery = self.body.battery
        drain_per_s = self.drain_per_s + (0.005 if "battery_drain" in self.faults else 0.0)
        if drain_per_s:
            battery.drain(drain_per_s * STEP_S)
        if battery.charge < _LOW_CHARGE and not self._low:
            self._low = True
            self._say("warn", f"battery low: {battery.charge:.0%}")
        elif battery.charge > 2 * _LOW_CHARGE:
            self._low = False
        if battery.charge > 0.0:
            return
        if self._empty_s == 0.0:
            self._say("error", f"battery empty: standing until it is swapped in {_SWAP_AFTER_S:.0f} s")
        self._empty_s += STEP_S
        if self._empty_s >= _SWAP_AFTER_S:
            battery.charge, self._low, self._empty_s = 1.0, False, 0.0
            self._say("info", "battery swapped: 100%")

    def _back_to_autonomy(self, line: str) -> None:
        self.autopilot.forget_route()
        self._say("info", line)

    def _say(self, level: str, text: str | None) -> None:
        if text is not None:
            self.events.append(Event(level, text))


class Fleet:
    """All robots, named `sim_<first>` onwards."""

    def __init__(
        self,
        *,
        robots: int,
        seed: int,
        first: int = 1,
        faults: Sequence[ScheduledFault] = (),
        resume_after_s: float = 10.0,
    ) -> None:
        places = start_places()
        if not 1 <= robots <= len(places):
            raise ConfigError(f"robots must be 1 to {len(places)}, not {robots}: the warehouse has no more room")
        if resume_after_s < 0.0 or not math.isfinite(resume_after_s):
            raise ConfigError(f"resume_after_s must be zero or more seconds, not {resume_after_s}")
        order = np.random.default_rng(seed).permutation(min(robots * 2, 15) if robots <= 15 else robots)
        self.tick = 0
        self.robots = [
            SimRobot(
                first + index,
                place=places[int(order[index])],
                rng=np.random.default_rng([seed, first + index]),
                resume_after_s=resume_after_s,
            )
            for index in range(robots)
        ]
        by_name = {robot.name: robot for robot in self.robots}
        unknown = [fault.robot for fault in faults if fault.robot not in by_name]
        if unknown:
            raise ConfigError(f"no robot {unknown[0]!r} to give a fault: there are {', '.join(by_name)}")
        self._faults = sorted(faults, key=lambda fault: fault.at_s)
        self._by_name = by_name

    def robot(self, name: str) -> SimRobot:
        """The robot of that name."""
        return self._by_name[name]

    def others(self, robot: SimRobot) -> tuple[Circle, ...]:
        """Every other robot's outline as it is now."""
        return tuple(other.circle() for other in self.robots if other is not robot)

    def numbered_others(self, robot: SimRobot) -> list[tuple[int, Circle]]:
        """The same with their numbers, which choose their colours."""
        return [(other.number, other.circle()) for other in self.robots if other is not robot]

    def step(self, *, now_s: float | None = None) -> None:
        """Advance all robots by STEP_S. `now_s` is the clock that commands were stamped with (default: simulated)."""
        while self._faults and self._faults[0].at_s <= self.tick * STEP_S:
            fault = self._faults.pop(0)
            self._by_name[fault.robot].inject(fault.fault)
        now_s = self.tick * STEP_S if now_s is None else now_s
        circles = [robot.circle() for robot in self.robots]
        for index, robot in enumerate(self.robots):
            robot.step(self.tick, (*circles[:index], *circles[index + 1 :]), now_s=now_s)
            circles[index] = robot.circle()
        self.tick += 1
