"""Metrics that do not fit together, each of which is still where it always was."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

from gateway.alerting.anomaly.detectors.vector import METRICS, VectorConfig, Vectors

CONFIG = VectorConfig(learn=300, smooth=1.0)


class Robot:
    """Three metrics: a speed, a current that follows it, and something of its own."""

    def __init__(self) -> None:
        self.vectors = Vectors(CONFIG)
        self.vectors.columns.grow(1)
        self.rng, self.at_s = np.random.default_rng(4), 0.0
        self.robots, self.places = np.zeros(3, np.int64), np.arange(3)

    def run(self, vectors: int, *, broken: bool = False) -> list[tuple[bool, int]]:
        """Edges, and the metric most to blame."""
        found = []
        for _ in range(vectors):
            self.at_s += 5.0
            speed = self.rng.normal()
            current = self.rng.normal() if broken else speed + 0.05 * self.rng.normal()
            self.vectors.put(self.robots, self.places, np.array((speed, current, self.rng.normal())), self.at_s)
            verdict = self.vectors.evaluate(np.array([0]), self.at_s)
            if verdict is not None:
                found += [
                    (bool(o), int(parts.argmax())) for o, parts in zip(verdict.opened, verdict.parts, strict=True)
                ]
        return found


@pytest.fixture(scope="module")
def learnt() -> Robot:
    made = Robot()
    assert made.run(1500) == []
    return made


@pytest.fixture
def robot(learnt: Robot) -> Robot:
    return deepcopy(learnt)


def test_a_broken_correlation_is_reported_and_the_metrics_of_it_are_blamed(robot: Robot) -> None:
    opened, blamed = robot.run(60, broken=True)[0]
    assert opened
    assert blamed in (0, 1)


def test_it_is_over_when_they_fit_again(robot: Robot) -> None:
    edges = [opened for opened, _ in robot.run(60, broken=True) + robot.run(200)]
    assert edges[0]
    assert not edges[-1]


def test_a_missing_metric_counts_as_its_mean(robot: Robot) -> None:
    robot.robots, robot.places = np.zeros(0, np.int64), np.zeros(0, np.int64)
    found = []
    for _ in range(100):
        robot.at_s += 5.0
        verdict = robot.vectors.evaluate(np.array([0]), robot.at_s)
        found += [] if verdict is None else verdict.opened.tolist()
    assert found == []


def test_nothing_is_reported_while_it_learns_and_constants_are_no_trouble() -> None:
    vectors = Vectors(CONFIG)
    vectors.columns.grow(1)
    for n in range(400):
        vectors.put(np.zeros(2, np.int64), np.arange(2), np.array((1.0, 2.0)), 5.0 * n)
        verdict = vectors.evaluate(np.array([0]), 5.0 * n)
        assert verdict is None or not len(verdict.robots)
    assert np.isfinite(vectors.columns["covariance"]).all()
    assert vectors.columns["covariance"].shape[1:] == (METRICS, METRICS)


def test_years_and_a_clock_set_back_tell_nothing(robot: Robot) -> None:
    robot.at_s += 3e8
    assert robot.run(50) == []
    robot.at_s = 7.0
    assert robot.run(50) == []
