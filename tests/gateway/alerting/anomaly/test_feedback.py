""" "This is normal", kind by kind: what is taught is no news any more, and what learns nothing says so."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.anomaly.detectors.cohort import Cohorts
from gateway.alerting.anomaly.detectors.lasting import Lasting, LastingConfig
from gateway.alerting.anomaly.detectors.vector import Vectors
from gateway.alerting.anomaly.evaluator import Evaluator, EvaluatorConfig
from gateway.alerting.anomaly.feedback import sentence, teaches
from gateway.domain.finding import Edge, Finding
from tests.gateway.alerting.anomaly.cellfeed import quick, second

CONFIG = EvaluatorConfig(lasting=LastingConfig(learn_s=600, epoch_s=300))
CHECKS = {check.id: check for check in DEFAULT_CHECKS}
START_S = 1e9


def reported(kind: str, value: float = 2.0) -> Finding:
    return Finding(
        robot="r", series="a.x", kind=kind, cause="change", severity="warning", score=0.8, value=value, low=0.0,
        high=1.0, reason="It is so.", since_s=START_S,
    )  # fmt: skip


def test_every_kind_says_what_it_learns() -> None:
    for kind, check in CHECKS.items():
        said = sentence(reported(kind), check)
        assert ("learns nothing" in said) == (not teaches(check)), kind
        assert teaches(check) == (check.kind in ("detector", "frozen", "silence", "rate")), kind


def test_a_vibration_that_is_normal_widens_how_it_may_shake_and_not_where_it_may_be() -> None:
    lasting, rng = Lasting(quick(LastingConfig(learn_s=600, epoch_s=300))), np.random.default_rng(1)
    lasting.grow(1)

    def run(spread: float, seconds: int, start_s: int) -> list[tuple[str, bool]]:
        found = []
        for n in range(seconds):
            cell = second(
                START_S + start_s + n, [25.0 + 0.2 * rng.normal()], count=10, spread=spread + 0.01 * rng.random()
            )
            found += [(change.kind, change.opened) for change in lasting.feed(cell)]
        return found

    assert run(0.1, 300, 0) == []
    assert ("vibration", True) in run(2.0, 10, 300)
    band = lasting.band(0)
    lasting.accept(0, "vibration", 2.0)
    assert lasting.band(0) == band
    run(0.1, 60, 310)
    assert run(2.0, 30, 370) == []


class Robot:
    """An evaluator with a robot of two topics; `run` gives what was told."""

    def __init__(self) -> None:
        self.evaluator, self.at = Evaluator(CONFIG), 0
        self.slots = [self.evaluator.slot("r", f"{name}.x", f"/{name}") for name in "ab"]

    def run(self, seconds: int, *, rows: tuple[int, int]) -> list[Edge]:
        found = []
        for _ in range(seconds):
            for slot, count in zip(self.slots, rows, strict=True):
                stamps = START_S + self.at + (np.arange(count) + 0.5) / max(count, 1)
                self.evaluator.samples(np.full(count, slot), stamps, np.sin(stamps))
            self.evaluator.heartbeat("r", START_S + self.at)
            found += self.evaluator.tick(START_S + self.at)
            self.at += 1
        return [edge for edge in found if edge.finding.kind in ("silence", "rate_low", "rate_high")]


@pytest.fixture(scope="module")
def learnt() -> Robot:
    """Both topics have come ten times a second for long enough."""
    robot = Robot()
    assert robot.run(200, rows=(10, 10)) == []
    return robot


@pytest.fixture
def robot(learnt: Robot) -> Robot:
    return deepcopy(learnt)


def test_a_silence_that_is_normal_may_last_as_long(robot: Robot) -> None:
    (edge,) = robot.run(20, rows=(10, 0))
    assert (edge.change, edge.finding.series, edge.finding.kind) == ("opened", "/b", "silence")
    robot.evaluator.accept("r", "/b", "silence", edge.finding.value)
    assert [edge.change for edge in robot.run(5, rows=(10, 0))] == ["cleared"]
    robot.run(60, rows=(10, 10))
    assert robot.run(20, rows=(10, 0)) == []


def test_a_rate_that_is_normal_is_the_usual_one(robot: Robot) -> None:
    (edge,) = robot.run(20, rows=(10, 3))
    assert (edge.change, edge.finding.series, edge.finding.kind) == ("opened", "/b", "rate_low")
    robot.evaluator.accept("r", "/b", "rate_low", 3.0)
    assert [edge.change for edge in robot.run(60, rows=(10, 3))] == ["cleared"]


def test_an_odd_one_out_that_is_normal_may_be_as_far_from_the_others() -> None:
    cohorts, slots = Cohorts(), np.arange(5)
    cohorts.columns.grow(5)
    cohorts.columns["group"][:5] = 0
    found = []
    for minute in range(230):
        at_s = START_S + 60.0 * minute
        cohorts.put(slots, np.array([1.0, 1.01, 0.99, 1.0, 3.0]), at_s)
        verdict = cohorts.evaluate(at_s)
        found += [] if verdict is None else verdict.slots[verdict.opened].tolist()
        if found and minute % 10 == 0:
            cohorts.accept(4)
    assert found == [4]


def test_a_distance_that_is_normal_is_not_reported_again() -> None:
    vectors = Vectors()
    vectors.columns.grow(1)
    vectors.accept(0, 50.0)
    assert vectors.columns["normal"][0] == 75.0
    assert vectors.columns["out"][0] == 0


def test_a_rate_that_the_agent_counts_is_reported_by_its_topic_and_taught_by_it() -> None:
    evaluator = Evaluator(CONFIG)

    def run(hz: float, seconds: range) -> list[Edge]:
        found = []
        for n in seconds:
            evaluator.rates("r", {"/r/scan": hz}, START_S + n)
            found += evaluator.tick(START_S + n)
        return found

    assert run(10.0, range(200)) == []
    (edge,) = run(3.0, range(200, 220))
    assert (edge.finding.series, edge.finding.kind) == ("/r/scan", "rate_low")
    evaluator.accept("r", "/r/scan", "rate_low", 3.0)
    assert [edge.change for edge in run(3.0, range(220, 300))] == ["cleared"]


def test_a_check_of_another_severity_goes_on_with_what_it_found_and_one_that_is_off_ends_it(robot: Robot) -> None:
    robot.run(20, rows=(10, 0))
    robot.evaluator.link("bare", up=True, now_s=START_S + robot.at)
    robot.evaluator.tick(START_S + robot.at + 60.0)
    severe = [replace(check, severity="error") if check.id == "silence" else check for check in DEFAULT_CHECKS]
    robot.evaluator.set_checks(severe)
    (edge,) = robot.run(3, rows=(10, 0))
    assert (edge.change, edge.finding.kind, edge.finding.severity) == ("changed", "silence", "error")
    robot.evaluator.set_checks([replace(check, enabled=check.id not in ("silence", "offline")) for check in severe])
    assert [edge.change for edge in robot.run(3, rows=(10, 0))] == ["cleared"]
    assert robot.evaluator.open("bare") == []
