"""The odd one out among robots that are alike."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

from gateway.alerting.anomaly.detectors.cohort import CohortConfig, Cohorts

CONFIG = CohortConfig(learn=60)


class Fleet:
    """Robots with one metric each, in one cohort."""

    def __init__(self, robots: int) -> None:
        self.cohorts = Cohorts(CONFIG)
        self.cohorts.columns.grow(robots)
        self.cohorts.columns["group"][:robots] = 7
        self.rng, self.at_s, self.robots = np.random.default_rng(9), 0.0, robots

    def run(self, minutes: int, *, hot: float = 0.0) -> list[tuple[int, bool, float, int]]:
        found = []
        for _ in range(minutes * 6):
            self.at_s += 10.0
            values = (
                48.0 + 2.0 * np.sin(self.at_s / 3600.0 + np.arange(self.robots)) + self.rng.normal(size=self.robots)
            )
            values[2] += hot
            self.cohorts.put(np.arange(self.robots), values, self.at_s)
            verdict = self.cohorts.evaluate(self.at_s)
            if verdict is not None:
                found += list(zip(verdict.slots, verdict.opened, verdict.median, verdict.others, strict=True))
        return [(int(slot), bool(opened), float(median), int(others)) for slot, opened, median, others in found]


@pytest.fixture(scope="module")
def learnt() -> Fleet:
    fleet = Fleet(6)
    assert fleet.run(300) == []
    return fleet


@pytest.fixture
def fleet(learnt: Fleet) -> Fleet:
    return deepcopy(learnt)


def test_one_that_is_other_for_long_is_reported_with_the_median_of_the_others(fleet: Fleet) -> None:
    slot, opened, median, others = fleet.run(120, hot=25.0)[0]
    assert (slot, opened, others) == (2, True, 5)
    assert 45.0 < median < 51.0
    assert [opened for _, opened, _, _ in fleet.run(300)] == [False]


def test_all_that_change_together_are_no_odd_ones(fleet: Fleet) -> None:
    fleet.cohorts.columns["mean"][:6] += 30.0
    assert fleet.run(100) == []


def test_three_are_no_cohort_and_neither_are_those_without_one() -> None:
    three = Fleet(3)
    assert three.run(70) + three.run(60, hot=25.0) == []
    lonely = Fleet(6)
    lonely.cohorts.columns["group"][:] = -1
    assert lonely.run(70) + lonely.run(60, hot=25.0) == []


def test_what_is_open_is_over_when_there_is_nobody_left_to_compare_with(fleet: Fleet) -> None:
    assert [opened for _, opened, _, _ in fleet.run(120, hot=25.0)] == [True]
    fleet.cohorts.columns["group"][3:6] = -1  # they went to another gateway
    assert [(slot, opened) for slot, opened, _, _ in fleet.run(60, hot=25.0)] == [(2, False)]
    assert fleet.run(120, hot=25.0) == []


def test_a_cohort_outlives_a_snapshot(fleet: Fleet) -> None:
    again = Fleet(6)
    again.cohorts.load(fleet.cohorts.dump())
    again.at_s, again.rng = fleet.at_s, np.random.default_rng(1)
    fleet.rng = np.random.default_rng(1)
    assert again.run(120, hot=25.0) == fleet.run(120, hot=25.0) != []
