"""Simulated robots' metrics in accelerated time: 40 series a robot, as their drivers would publish them.

Motions move motors, motors heat and draw from a battery, the computer works harder while driving, the radio depends on
where the robot is. Sensors add noise, round to their steps and lose a sample now and then; once in some days a robot
starts anew, and its drivers come back one after the other. Every robot is a little different from the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gateway.alerting.anomaly.detectors.columns import Bools, Floats
from load_tests.anomaly.motion import DAY_S, TRACK_M, Motion, Motions

__all__ = ["FAST", "HOST_TOPICS", "RATES_HZ", "SERIES", "SLOW", "Robots", "Seconds", "Series"]


@dataclass(frozen=True, slots=True)
class Series:
    """A metric: its topic and field, its sensor's noise, and the step it is rounded to (0 = none)."""

    topic: str
    field: str
    noise: float = 0.0
    step: float = 0.0

    @property
    def name(self) -> str:
        """As the agent names it."""
        return f"{self.topic.strip('/').replace('/', '.')}.{self.field}"


FAST = (
    Series("/odom", "pose.pose.position.x"),
    Series("/odom", "pose.pose.position.y"),
    Series("/odom", "twist.twist.linear.x"),
    Series("/odom", "twist.twist.angular.z"),
    Series("/joint_states", "velocity[0]", step=0.002),
    Series("/joint_states", "velocity[1]", step=0.002),
    Series("/joint_states", "effort[0]", noise=0.03),
    Series("/joint_states", "effort[1]", noise=0.03),
    Series("/left/motor_temperature", "temperature", noise=0.06, step=0.1),
    Series("/right/motor_temperature", "temperature", noise=0.06, step=0.1),
    Series("/left/motor", "current", noise=0.03, step=0.01),
    Series("/right/motor", "current", noise=0.03, step=0.01),
    Series("/battery_state", "percentage", step=0.001),
    Series("/battery_state", "voltage", noise=0.008, step=0.005),
    Series("/battery_state", "current", noise=0.05, step=0.02),
    Series("/battery_state", "temperature", noise=0.03, step=0.1),
    Series("/imu", "angular_velocity.z", noise=0.003),
    Series("/imu", "linear_acceleration.x", noise=0.02),
    Series("/imu", "linear_acceleration.y", noise=0.02),
    Series("/imu", "linear_acceleration.z", noise=0.02),
    Series("/scan", "valid", noise=0.004),
    Series("/scan", "nearest", noise=0.01),
    Series("/cmd_vel", "linear.x"),
    Series("/cmd_vel", "angular.z"),
    Series("/localization", "score", noise=0.008),
)
SLOW = (
    Series("/host/cpu", "percent", noise=1.5, step=0.1),
    Series("/host/cpu", "load_1m", step=0.01),
    Series("/host/memory", "percent", noise=0.1, step=0.1),
    Series("/host/disk", "percent", step=0.1),
    Series("/host/temperature", "celsius", noise=0.3, step=1.0),
    Series("/host/network", "rx_bytes_per_s"),
    Series("/host/network", "tx_bytes_per_s"),
    Series("/radio", "signal", noise=1.0, step=1.0),
    Series("/radio", "rtt"),
)
SERIES = FAST + SLOW
HOST_TOPICS = tuple(dict.fromkeys(series.topic for series in SLOW))
FAST_TOPICS = tuple(dict.fromkeys(series.topic for series in FAST))
RATES_HZ = {"/odom": 50.0, "/imu": 100.0, "/scan": 10.0, "/camera": 15.0, "/joint_states": 50.0, "/battery_state": 5.0}
_CHARGE = (0.0, 0.05, 0.1, 0.2, 0.5, 0.8, 0.95, 1.0)
_OPEN_V = (20.0, 22.6, 23.6, 24.6, 25.6, 26.6, 27.4, 28.4)
PLACE = {series.name: place for place, series in enumerate(SERIES)}


@dataclass(slots=True)
class Seconds:
    """One second of all robots: values (steps, robots, series), and which samples exist (steps, robots, topics)."""

    fast: Floats
    slow: Floats
    fast_there: Bools
    slow_there: Bools
    rates_hz: Floats


class Robots:
    """All robots. `hot`, `sag` and `motions.stuck` are faults of the bodies, 0 where there are none."""

    def __init__(self, count: int, *, rate_hz: int, rng: np.random.Generator, hour: float | None = None) -> None:
        """`hour` is the local time at which all begin; without it each robot has its own."""
        self._rng, self.count, self.rate_hz = rng, count, rate_hz
        self.steps = max(rate_hz, 5)
        self.motions = Motions(count, steps=self.steps, rng=rng)
        self.at_s = 0.0
        self.start_s = np.full(count, hour * 3600.0) if hour is not None else rng.uniform(0.0, DAY_S, count)
        self.charge = rng.uniform(0.3, 0.6, count)
        self.hot, self.sag = np.zeros(count), np.zeros(count)
        self._motor_c, self._battery_c, self._host_c = (
            np.full((2, count), 30.0),
            np.full(count, 27.0),
            np.full(count, 50.0),
        )
        self._pose = rng.uniform(-8.0, 8.0, (2, count))
        self._dock = rng.uniform(-9.0, 9.0, (2, count))
        self._heading = rng.uniform(-3.0, 3.0, count)
        self._friction = rng.normal(1.0, 0.05, (2, count))
        self._bias = rng.normal(0.0, 0.002, (4, count))
        self._site_c = rng.normal(22.0, 1.5, count)
        self._slow = {name: np.zeros(count) for name in ("cpu", "cpu2", "load", "radio", "score", "near", "job", "net")}
        self._memory, self._disk = rng.uniform(35.0, 50.0, count), rng.uniform(30.0, 60.0, count)
        self._job_left = np.zeros(count)
        self._away = np.zeros((count, len(FAST_TOPICS) + len(HOST_TOPICS)))  # seconds for which a topic is missing

    def second(self) -> Seconds:
        """The next second of all."""
        clock_s = (self.start_s + self.at_s) % DAY_S
        self.at_s += 1.0
        way = self._dock - self._pose
        homing = self.motions.homing & ~self.motions.docked
        self._heading = np.where(homing, np.arctan2(way[1], way[0]), self._heading)
        motion = self.motions.second(self.charge, clock_s, np.hypot(*way) < 0.8)
        currents = self._currents(motion)
        self._heat(currents, clock_s)
        voltage, battery_a = self._power(currents, motion)
        fast = self._fast(motion, currents, voltage, battery_a)
        slow = self._host(motion)
        fast_there, slow_there = self._losses()
        rates = np.array(list(RATES_HZ.values())) + self._rng.normal(0.0, 0.6, (self.count, len(RATES_HZ)))
        return Seconds(fast, slow, fast_there, slow_there, np.round(np.maximum(rates, 0.0)))

    def _currents(self, motion: Motion) -> Floats:
        """Of both motors, (2, steps, robots): friction, slope, load, acceleration; a blocked one stalls."""
        heavy = 1.0 + 0.35 * motion.loaded
        both = []
        for side, (speed, accel) in enumerate(((motion.left, motion.left_accel), (motion.right, motion.right_accel))):
            effort = 0.3 + 1.1 * np.abs(speed) + heavy * (0.9 * np.abs(accel) + 12.0 * np.maximum(motion.slope, -0.02))
            both.append(np.where(np.abs(speed) > 1e-6, np.clip(effort * self._friction[side], 0.1, 6.5), 0.15))
        wanted = np.abs(motion.linear_command - motion.angular_command * TRACK_M / 2) > 0.02
        both[0] = np.where(self.motions.stuck & wanted, 9.0, both[0])
        return np.array(both)

    def _heat(self, currents: Floats, clock_s: Floats) -> None:
        """Motors and battery follow what they carry, the site the sun."""
        self._ambient = self._site_c + 3.0 * np.sin((clock_s / DAY_S - 0.375) * 2.0 * np.pi)
        squared = (currents**2).mean(axis=1)
        goal = self._ambient + 8.0 * squared / (1.0 + 0.05 * squared)
        self._motor_c += (goal - self._motor_c) / 180.0
        self._motor_c[0] += (self.hot > 0.0) * (self._ambient + self.hot - self._motor_c[0]).clip(0.0) / 90.0

    def _power(self, currents: Floats, motion: Motion) -> tuple[Floats, Floats]:
        """The battery's voltage and current, (steps, robots): negative while it is charged."""
        taper = np.clip((1.0 - self.charge) / 0.15, 0.03, 1.0)
        drawn = 1.3 + currents.sum(axis=0) * 0.9
        battery_a = np.where(motion.docked, 1.2 - 8.0 * taper, drawn)
        open_v = np.interp(self.charge, _CHARGE, _OPEN_V)
        voltage = open_v - self.sag - battery_a * (0.06 + 0.02 * self.sag)
        mean_a = battery_a.mean(axis=0)
        self.charge = np.clip(self.charge - mean_a / 3600.0 / 12.0, 0.0, 1.0)
        self._battery_c += (self._ambient + 3.0 + 0.12 * mean_a**2 - self._battery_c) / 600.0
        return voltage, battery_a

    def _fast(self, motion: Motion, currents: Floats, voltage: Floats, battery_a: Floats) -> Floats:
        """The drivers' metrics at the published rate."""
        rng, dt_s = self._rng, 1.0 / self.steps
        linear, angular = (motion.left + motion.right) / 2, (motion.right - motion.left) / TRACK_M
        heading = self._heading + np.cumsum(angular, axis=0) * dt_s
        x = self._pose[0] + np.cumsum(linear * np.cos(heading), axis=0) * dt_s
        y = self._pose[1] + np.cumsum(linear * np.sin(heading), axis=0) * dt_s
        self._pose, self._heading = self._bounce(x[-1], y[-1], heading[-1])
        moves = np.abs(linear) + np.abs(angular) > 1e-6
        shake = 0.1 * np.abs(linear) * rng.normal(size=(3, *linear.shape))
        self._wander("score", 0.98, 0.01)
        self._wander("near", 0.95, 0.25)
        score = np.clip(0.9 + self._slow["score"] - 0.04 * np.abs(angular), 0.0, 1.0)
        still = np.ones_like(linear)
        rolling = moves * rng.normal(0.0, 1.0, (4, *linear.shape))
        columns = (
            x, y, linear + 0.004 * rolling[0], angular + 0.01 * rolling[1],
            motion.left + 0.008 * rolling[2], motion.right + 0.008 * rolling[3], currents[0] * 0.45, currents[1] * 0.45,
            still * self._motor_c[0], still * self._motor_c[1], currents[0] * (1.0 + 0.04 * rolling[0]),
            currents[1] * (1.0 + 0.04 * rolling[1]), still * self.charge, voltage, battery_a, still * self._battery_c,
            angular + self._bias[0], (motion.left_accel + motion.right_accel) / 2 + shake[0] + self._bias[1],
            linear * angular + shake[1] + self._bias[2], 9.81 + shake[2] + self._bias[3],
            still * np.clip(0.97 + 0.5 * self._slow["score"], 0.0, 1.0),
            still * (0.6 + np.abs(1.2 + self._slow["near"])),
            still * motion.linear_command, still * motion.angular_command, score,
        )  # fmt: skip
        picked = np.stack(columns, axis=-1)[:: self.steps // self.rate_hz]
        return self._sensed(picked, FAST)

    def _host(self, motion: Motion) -> Floats:
        """The computer's and the radio's metrics, once a second."""
        rng, slow = self._rng, self._slow
        self._wander("cpu", 0.9, 2.0)
        self._wander("cpu2", 0.999, 0.25)
        self._job_left = np.where(
            rng.random(self.count) < 1.0 / 5400.0, rng.uniform(15.0, 150.0, self.count), self._job_left - 1
        )
        job = self._job_left > 0.0
        busy = np.where(motion.docked, 14.0, np.where(self.motions.driving, 46.0, 34.0)) + 35.0 * job
        cpu = np.clip(busy + slow["cpu"] + slow["cpu2"], 1.0, 100.0)
        slow["load"] += (cpu / 100.0 * 4.0 - slow["load"]) / 60.0
        self._memory += 0.0004 + (rng.random(self.count) < 1.0 / 30_000.0) * (38.0 - self._memory)
        self._disk += 0.00008 + (rng.random(self.count) < 1.0 / 80_000.0) * (35.0 - self._disk)
        self._host_c += (self._ambient + 12.0 + 0.45 * cpu - self._host_c) / 120.0
        self._wander("radio", 0.95, 1.0)
        signal = -48.0 - 1.4 * np.hypot(self._pose[0] - 3.0, self._pose[1] + 2.0) + slow["radio"]
        rtt = np.exp(1.6 + 0.35 * rng.normal(size=self.count) + np.maximum(0.0, -62.0 - signal) * 0.04)
        rtt += (rng.random(self.count) < 0.002) * rng.exponential(120.0, self.count)
        traffic = np.exp(0.25 * rng.normal(size=(2, self.count)))
        received = (4000.0 + 20_000.0 * job) * traffic[0]
        sent = np.where(motion.docked, 9000.0, 30_000.0) * traffic[1] + 200_000.0 * job
        columns = (cpu, slow["load"], self._memory, self._disk, self._host_c, received, sent, signal, rtt)
        return self._sensed(np.stack(columns, axis=-1), SLOW)

    def _sensed(self, truth: Floats, series: tuple[Series, ...]) -> Floats:
        noise, step = np.array([item.noise for item in series]), np.array([item.step for item in series])
        seen = truth + noise * self._rng.normal(size=truth.shape)
        rounded: Floats = np.where(step > 0.0, np.round(seen / np.where(step > 0.0, step, 1.0)) * step, seen)
        return rounded

    def _losses(self) -> tuple[Bools, Bools]:
        """A sample in a thousand is lost, a topic stalls a moment, and rarely a whole robot starts anew."""
        rng, shape = self._rng, self._away.shape
        self._away -= 1.0
        stall = rng.random(shape) < 1.0 / 20_000.0
        self._away = np.where(stall & (self._away <= 0.0), rng.uniform(0.2, 1.5, shape), self._away)
        restart = rng.random(self.count) < 1.0 / (2.0 * DAY_S)
        back = rng.uniform(25.0, 60.0, (self.count, 1)) + rng.uniform(0.0, 20.0, shape)
        self._away = np.where(restart[:, None], back, self._away)
        phase = (np.arange(self.rate_hz) + 0.5)[:, None, None] / self.rate_hz
        there = phase >= self._away
        there &= rng.random(there.shape) >= 0.001
        return there[:, :, : len(FAST_TOPICS)], there[self.rate_hz // 2, :, len(FAST_TOPICS) :]

    def _wander(self, name: str, keep: float, step: float) -> None:
        self._slow[name] = keep * self._slow[name] + step * self._rng.normal(size=self.count)

    @staticmethod
    def _bounce(x: Floats, y: Floats, heading: Floats) -> tuple[Floats, Floats]:
        """Who leaves the hall turns towards its middle."""
        out = (np.abs(x) > 12.0) | (np.abs(y) > 10.0)
        home = np.arctan2(-y, -x)
        return np.array((np.clip(x, -12.5, 12.5), np.clip(y, -10.5, 10.5))), np.where(out, home, heading)
