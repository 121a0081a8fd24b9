"""The benchmark of faults: honest robots, faults that touch what they say, and a small sample of it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from gateway.alerting.anomaly.detectors.lasting import LastingConfig
from gateway.alerting.anomaly.evaluator import Evaluator, EvaluatorConfig
from load_tests.anomaly import faults
from load_tests.anomaly.injected import KINDS, Fault, inject, plan
from load_tests.anomaly.robots import FAST_TOPICS, PLACE, SERIES, Robots


def robots(count: int = 4, *, seed: int = 5) -> Robots:
    return Robots(count, rate_hz=10, rng=np.random.default_rng(seed), hour=8.0)


def test_the_same_seed_makes_the_same_robots() -> None:
    one, two = robots(), robots()
    for _ in range(50):
        a, b = one.second(), two.second()
        assert np.array_equal(a.fast, b.fast)
        assert np.array_equal(a.slow, b.slow)
        assert np.array_equal(a.fast_there, b.fast_there)


def test_robots_drive_heat_their_motors_and_empty_their_batteries() -> None:
    bodies = robots()
    charge, away = bodies.charge.copy(), ~bodies.motions.docked
    speeds = [bodies.second().fast[:, :, PLACE["odom.twist.twist.linear.x"]] for _ in range(600)]
    assert 0.5 < np.max(speeds) < 1.5
    assert np.min(np.abs(speeds)) == 0.0
    away &= ~bodies.motions.docked
    assert away.any()
    assert (bodies.charge < charge)[away].all()
    last = bodies.second()
    assert np.isfinite(last.fast).all()
    assert np.isfinite(last.slow).all()
    assert (last.fast[:, away, PLACE["left.motor_temperature.temperature"]] > 20.0).all()


def test_every_kind_comes_as_often_and_no_two_overlap_at_a_robot() -> None:
    made = plan(5, 10, learn_s=1000.0, rng=np.random.default_rng(1))
    assert {kind.name: sum(fault.kind == kind for fault in made) for kind in KINDS} == dict.fromkeys(
        (kind.name for kind in KINDS), 10
    )
    for robot in range(5):
        mine = sorted((fault for fault in made if fault.robot == robot), key=lambda fault: fault.due_s)
        for before, after in itertools.pairwise(mine):
            assert after.due_s > before.due_s + before.kind.lasts_s + 600.0


def fault(name: str, **fields: object) -> Fault:
    kind = next(kind for kind in KINDS if kind.name == name)
    return Fault(kind, 1, 0.0, begin_s=0.0, **fields)  # type: ignore[arg-type]


def test_faults_touch_their_robot_and_nothing_else() -> None:
    bodies, rng, sizes = robots(), np.random.default_rng(2), np.ones((4, len(SERIES)))
    place, topic = PLACE["imu.angular_velocity.z"], FAST_TOPICS.index("/imu")
    cases = (
        fault("sensor dropout", topic="/imu"),
        fault("rate drop", topic="/imu", size=0.3),
        fault("flat line", topic="/imu", places=[place]),
        fault("step", topic="/imu", places=[place], size=4.0),
    )
    for case in cases:
        before = bodies.second()
        fast, there = before.fast.copy(), before.fast_there.copy()
        inject(case, bodies, before, sizes, now_s=5.0, rng=rng)
        others = np.arange(4) != 1
        assert np.array_equal(before.fast[:, others], fast[:, others])
        assert np.array_equal(before.fast_there[:, others], there[:, others])
        kept = int(before.fast_there[:, 1, topic].sum())
        change = before.fast[:, 1, place] - fast[:, 1, place]
        if case.kind.name in ("sensor dropout", "rate drop"):
            assert kept <= (0 if case.kind.name == "sensor dropout" else 4)
        elif case.kind.name == "flat line":
            assert np.ptp(before.fast[:, 1, place]) == 0.0
        else:
            assert np.allclose(change, 4.0)


def test_a_stuck_wheel_stands_still_and_draws_its_stall_current() -> None:
    bodies = robots()
    while not bodies.motions.driving[1]:
        bodies.second()
    inject(fault("stuck wheel"), bodies, bodies.second(), np.zeros((4, len(SERIES))), now_s=5.0, rng=bodies._rng)
    seconds = [bodies.second() for _ in range(60)]
    speed = np.array([second.fast[:, 1, PLACE["joint_states.velocity[0]"]] for second in seconds])
    assert np.abs(speed[1:]).max() < 0.05
    assert max(second.fast[:, 1, PLACE["left.motor.current"]].max() for second in seconds) > 8.0


@pytest.mark.integration
def test_silence_and_slow_topics_are_all_found_within_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    short = EvaluatorConfig(lasting=LastingConfig(learn_s=600))
    monkeypatch.setattr(faults, "Evaluator", lambda: Evaluator(short))
    # All are driving early, none has its fault before 600 s; only the slow drift could still be found at the end.
    found = faults.run(each=1, robots=9, seed=8, learn_s=300.0, until_s=1200.0, verbose=False)
    assert all(item.begin_s >= 600.0 for item in found)
    sure = [item for item in found if item.kind.name in ("sensor dropout", "rate drop")]
    assert all(0.0 < item.found_s - item.begin_s <= 10.0 for item in sure)
    assert sum(item.found_s >= 0.0 for item in found) >= 0.7 * len(found)
