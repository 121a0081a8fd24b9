"""The faults of the benchmark: what breaks, how long, what it does to a robot's body or to what its sensors say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gateway.alerting.anomaly.detectors.columns import Floats
from load_tests.anomaly.robots import FAST, FAST_TOPICS, PLACE, RATES_HZ, SERIES, Robots, Seconds

__all__ = ["KINDS", "Fault", "FaultKind", "inject", "plan"]

MOVING = (
    "odom.twist.twist.linear.x", "odom.twist.twist.angular.z", "joint_states.velocity[0]", "joint_states.effort[1]",
    "left.motor.current", "right.motor.current", "battery_state.voltage", "battery_state.current",
    "imu.angular_velocity.z", "imu.linear_acceleration.x", "scan.valid", "scan.nearest", "localization.score",
)  # fmt: skip
STEPPED = (
    "left.motor_temperature.temperature", "battery_state.voltage", "battery_state.current", "left.motor.current",
    "imu.angular_velocity.z", "imu.linear_acceleration.x", "imu.linear_acceleration.z", "scan.valid",
    "localization.score", "battery_state.temperature",
)  # fmt: skip
DRIFTING = (
    "left.motor_temperature.temperature", "battery_state.voltage", "imu.angular_velocity.z",
    "imu.linear_acceleration.x", "imu.linear_acceleration.z", "scan.valid", "localization.score",
    "battery_state.temperature", "host.temperature.celsius", "radio.signal",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One kind: how long it lasts, and whether it is there at once."""

    name: str
    lasts_s: float
    abrupt: bool
    moving: bool  # begins only while the robot drives: elsewhere it cannot show


KINDS = (
    FaultKind("sensor dropout", 120.0, True, False),
    FaultKind("rate drop", 180.0, True, False),
    FaultKind("flat line", 240.0, True, True),
    FaultKind("step", 300.0, True, False),
    FaultKind("drift", 2400.0, False, False),
    FaultKind("vibration", 300.0, False, True),
    FaultKind("stuck wheel", 90.0, True, True),
    FaultKind("hot motor", 600.0, False, False),
    FaultKind("battery sag", 300.0, False, False),
)


@dataclass(slots=True)
class Fault:
    """One fault of one robot. `begin_s` is set when it begins; `series` are those a finding of it may name."""

    kind: FaultKind
    robot: int
    due_s: float
    topic: str = ""
    places: Sequence[int] = ()
    size: float = 0.0
    begin_s: float = -1.0
    found_s: float = -1.0
    found_by: str = ""
    held: dict[int, float] = field(default_factory=dict)

    def names(self) -> set[str]:
        """Series and topics by which it may be found."""
        if self.kind.name in ("stuck wheel", "hot motor", "battery sag", "vibration"):
            return {item for series in FAST for item in (series.name, series.topic)} | {""}
        rate = "topic_rates." + self.topic.strip("/")
        return {SERIES[place].name for place in self.places} | {self.topic, rate, ""}


def plan(robots: int, each: int, *, learn_s: float, rng: np.random.Generator) -> list[Fault]:
    """`each` faults of every kind, spread over the robots, with a pause after each in which it is over."""
    faults = []
    due = np.full(robots, learn_s)
    order = [kind for _ in range(each) for kind in KINDS]
    for number, kind in enumerate(rng.permutation(np.array(order, dtype=object)).tolist()):
        robot = number % robots
        due[robot] += rng.uniform(400.0, 900.0)
        faults.append(_fault(kind, robot, float(due[robot]), rng))
        due[robot] += kind.lasts_s + 600.0
    return faults


def _fault(kind: FaultKind, robot: int, due_s: float, rng: np.random.Generator) -> Fault:
    fault = Fault(kind, robot, due_s)
    if kind.name in ("sensor dropout", "rate drop"):
        fault.topic = str(rng.choice(np.array(FAST_TOPICS)))
        fault.places = [place for place, series in enumerate(FAST) if series.topic == fault.topic]
        fault.size = float(rng.uniform(0.2, 0.45))
    elif kind.name in ("flat line", "step", "drift"):
        chosen = {"flat line": MOVING, "step": STEPPED, "drift": DRIFTING}[kind.name]
        place = PLACE[str(rng.choice(np.array(chosen)))]
        fault.topic = SERIES[place].topic
        whole = kind.name == "flat line" and rng.random() < 0.5
        fault.places = [n for n, series in enumerate(FAST) if series.topic == fault.topic] if whole else [place]
        fault.size = float(rng.uniform(3.0, 6.0) * rng.choice((-1.0, 1.0)))
    else:
        low, high = {
            "vibration": (3.0, 6.0),
            "stuck wheel": (1.0, 1.0),
            "hot motor": (45.0, 70.0),
            "battery sag": (1.5, 3.0),
        }[kind.name]
        fault.size = float(rng.uniform(low, high))
    return fault


def inject(
    fault: Fault, robots: Robots, seconds: Seconds, deviations: Floats, *, now_s: float, rng: np.random.Generator
) -> None:
    """What the fault does to this second's samples; `deviations` are each robot's and series' own, learnt before."""
    age_s, name, robot = now_s - fault.begin_s, fault.kind.name, fault.robot
    if name in ("sensor dropout", "rate drop"):
        keep = 0.0 if name == "sensor dropout" else fault.size
        steps = np.arange(len(seconds.fast)) + age_s * len(seconds.fast)
        kept = np.floor((steps + 1.0) * keep) > np.floor(steps * keep)
        seconds.fast_there[:, robot, FAST_TOPICS.index(fault.topic)] &= kept
        if fault.topic in RATES_HZ:
            seconds.rates_hz[robot, list(RATES_HZ).index(fault.topic)] *= keep
    elif name == "flat line":
        for place in fault.places:
            seconds.fast[:, robot, place] = fault.held.setdefault(place, float(seconds.fast[0, robot, place]))
    elif name in ("step", "drift"):
        grown = 1.0 if name == "step" else min(1.0, age_s / fault.kind.lasts_s)
        for place in fault.places:
            added = grown * fault.size * deviations[robot, place]
            if place < len(FAST):
                seconds.fast[:, robot, place] += added
            else:
                seconds.slow[robot, place - len(FAST)] += added
    elif name == "vibration":
        _shake(fault, seconds, rng)
    else:
        _break(fault, robots, age_s)


def _shake(fault: Fault, seconds: Seconds, rng: np.random.Generator) -> None:
    """A loose wheel shakes the more the faster it turns, and its motor's current with it."""
    speed = np.abs(seconds.fast[:, fault.robot, PLACE["odom.twist.twist.linear.x"]])
    for axis in "xyz":
        place = PLACE[f"imu.linear_acceleration.{axis}"]
        seconds.fast[:, fault.robot, place] += 0.1 * fault.size * speed * rng.normal(size=len(speed))
    current = PLACE["left.motor.current"]
    seconds.fast[:, fault.robot, current] += 0.05 * fault.size * speed * rng.normal(size=len(speed))


def _break(fault: Fault, robots: Robots, age_s: float) -> None:
    """A fault of the body; the next second is the first that shows it."""
    over = age_s >= fault.kind.lasts_s - 1.0
    if fault.kind.name == "stuck wheel":
        robots.motions.stuck[fault.robot] = not over
    elif fault.kind.name == "hot motor":
        robots.hot[fault.robot] = 0.0 if over else fault.size
    else:
        robots.sag[fault.robot] = 0.0 if over else fault.size * min(1.0, age_s / 40.0)
