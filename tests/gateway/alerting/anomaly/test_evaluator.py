"""Everything together: what a robot does becomes findings with names, bands and reasons."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.anomaly.detectors.bank import BankConfig, SnapshotError
from gateway.alerting.anomaly.detectors.cohort import CohortConfig
from gateway.alerting.anomaly.detectors.lasting import LastingConfig
from gateway.alerting.anomaly.detectors.presence import PresenceConfig
from gateway.alerting.anomaly.detectors.rates import RateConfig
from gateway.alerting.anomaly.detectors.vector import VectorConfig
from gateway.alerting.anomaly.evaluator import Evaluator, EvaluatorConfig
from gateway.domain.finding import Edge
from tests.gateway.alerting.anomaly.cellfeed import quick

CONFIG = EvaluatorConfig(lasting=quick(LastingConfig(learn_s=800, epoch_s=400)))
LEARN_S = 280
MOTOR, WAVE, CALM = "left.motor_temperature.temperature", "imu.angular_velocity.z", "odom.twist.twist.linear.x"
TOPICS = {MOTOR: "/left/motor_temperature", WAVE: "/imu", CALM: "/odom"}


class Robots:
    """Some robots with three series each, at 10 Hz."""

    def __init__(self, evaluator: Evaluator, count: int = 1) -> None:
        self.evaluator, self.rng, self.second = evaluator, np.random.default_rng(8), 0
        self.names = [f"r{n}" for n in range(count)]
        self.slots = np.array(
            [[evaluator.slot(name, series, TOPICS[series]) for series in TOPICS] for name in self.names]
        )
        self.offset = np.zeros(3)

    def run(self, seconds: int, *, silent: str = "") -> list[Edge]:
        edges = []
        for _ in range(seconds):
            at_s = 1e9 + self.second
            values = np.array((40.0, 0.0, 0.5)) + 0.3 * self.rng.normal(size=(10, len(self.names), 3)) + self.offset
            stamps = np.broadcast_to((at_s + 0.05 + 0.1 * np.arange(10))[:, None, None], values.shape)
            there = np.array([series != silent for series in TOPICS])
            slots = np.broadcast_to(self.slots, values.shape)
            self.evaluator.samples(slots[..., there].ravel(), stamps[..., there].ravel(), values[..., there].ravel())
            for name in self.names:
                self.evaluator.heartbeat(name, at_s + 1.0)
            edges += self.evaluator.tick(at_s + 1.0)
            self.second += 1
        return edges


@pytest.fixture(scope="module")
def learnt() -> bytes:
    made = Robots(Evaluator(CONFIG))
    assert made.run(LEARN_S) == []
    return made.evaluator.dump()


@pytest.fixture
def robots(learnt: bytes) -> Robots:
    made = Robots(Evaluator.load(learnt, CONFIG))
    made.rng, made.second = np.random.default_rng(9), LEARN_S
    return made


def test_a_hot_motor_is_reported_with_its_band_and_reason_and_clears_by_itself(robots: Robots) -> None:
    robots.offset[0] = 50.0
    edges = {edge.finding.kind: edge.finding for edge in robots.run(12)}
    hot = edges["motor_hot"]
    assert (hot.robot, hot.series, hot.cause, hot.severity, hot.high) == ("r0", MOTOR, "heat", "warning", 80.0)
    assert hot.value > 80.0
    assert "above 80 °C for 5 s" in hot.reason
    assert 0.5 <= hot.score <= 1.0
    assert {finding.kind for finding in robots.evaluator.open("r0")} >= {"motor_hot"}
    robots.offset[0] = 0.0
    while robots.evaluator.open():
        robots.run(20)
        assert robots.second < LEARN_S + 1200


def test_another_level_is_reported_with_where_it_was_expected(robots: Robots) -> None:
    robots.offset[1] = 3.0
    edge = next(edge for edge in robots.run(12) if edge.finding.kind == "level")
    assert (edge.change, edge.finding.series) == ("opened", WAVE)
    assert edge.finding.low < 0.0 < edge.finding.high < 3.0
    assert "expected" in edge.finding.reason
    low, high = robots.evaluator.band(robots.evaluator.find("r0", WAVE))
    assert low < 0.0 < high


def test_a_silent_topic_is_reported_by_the_other_ones_and_offline_by_the_gateways_clock(robots: Robots) -> None:
    silence = [edge.finding for edge in robots.run(6, silent=CALM) if edge.finding.kind == "silence"]
    assert [(found.series, found.cause) for found in silence] == [("/odom", "silence")]
    robots.run(20)
    edges = robots.evaluator.tick(1e9 + robots.second + 40.0)
    assert [(edge.finding.kind, edge.finding.severity) for edge in edges] == [("offline", "error")]


def test_this_is_normal_closes_a_finding_and_is_remembered(robots: Robots) -> None:
    robots.offset[1] = 3.0
    robots.run(30)
    assert any(finding.series == WAVE for finding in robots.evaluator.open("r0"))
    for value in (3.0, 4.2, 1.8):
        robots.evaluator.accept("r0", WAVE, "level", value)
    robots.evaluator.accept("r0", "nothing", "level", 1.0)
    robots.evaluator.accept("r0", WAVE, "level", math.nan)
    assert {edge.change for edge in robots.evaluator.tick(1e9 + robots.second)} == {"cleared"}
    assert [
        edge for edge in robots.run(30) if edge.finding.kind in ("level", "novelty") and edge.change == "opened"
    ] == []


def test_rates_from_the_robot_are_judged_like_topics() -> None:
    evaluator, found = Evaluator(CONFIG), []
    for second in range(260):
        hz = 50.0 if second < 180 else 15.0
        rates = {"/scan": 10.0} if second >= 220 else {"/scan": 10.0, "/camera/image": hz}
        evaluator.rates("r", rates, 1e9 + second)
        found += [(second, edge.finding.series, edge.finding.kind) for edge in evaluator.tick(1e9 + second)]
    assert [row[1:] for row in found] == [("/camera/image", "rate_low")]
    assert found[0][0] <= 185


def test_a_restart_goes_on_to_the_last_bit(robots: Robots) -> None:
    robots.evaluator.samples(np.array([0]), np.array([1e9 + robots.second + 0.01]), np.array([41.0]))
    data = robots.evaluator.dump()
    other = Robots(Evaluator.load(data, CONFIG))
    other.rng, other.second = np.random.default_rng(77), robots.second
    robots.rng = np.random.default_rng(77)
    robots.offset[1] = other.offset[1] = 3.0
    assert other.run(60) == robots.run(60) != []
    assert other.evaluator.dump() == robots.evaluator.dump()


def test_a_damaged_snapshot_is_refused(robots: Robots) -> None:
    whole = robots.evaluator.dump()
    for damaged in (whole[: len(whole) // 2], b"", b"x" * 1000):
        with pytest.raises(SnapshotError):
            Evaluator.load(damaged, CONFIG)


def test_a_snapshot_of_other_parameters_is_refused(robots: Robots) -> None:
    with pytest.raises(SnapshotError, match="parameter"):
        Evaluator.load(robots.evaluator.dump())


def test_junk_years_and_clocks_that_jump_are_no_storm(robots: Robots) -> None:
    slots = robots.slots.ravel()
    for value in (math.nan, math.inf, -math.inf):
        robots.evaluator.samples(slots, np.full(3, 1e9 + robots.second), np.full(3, value))
    robots.evaluator.samples(slots, np.full(3, math.nan), np.zeros(3))
    for jump_s in (315_000_000, -315_000_000, 86_400):
        robots.second += jump_s
        assert [edge for edge in robots.run(30) if edge.finding.kind not in ("behind", "ahead")] == []


SOON = EvaluatorConfig(
    bank=BankConfig(learn_samples=3, learn_s=0.0, profile_learn_s=0.0, places=8, window_samples=2, blocks=2, bins=4),
    lasting=LastingConfig(window=(1, 2, 3, 4), learn_s=8, epoch_s=8, adopt_s=20, memory_s=100),
    presence=PresenceConfig(learn_s=3.0, grace_s=2.0),
    rates=RateConfig(learn=3, memory=10),
    vector=VectorConfig(period_s=1.0, learn=8, refresh=3),
    cohort=CohortConfig(least=2, period_s=2.0, learn=3, need=2, clear=2),
)
ENDS = (0.0, -0.0, 5e-324, 2.2e-308, 9.9e99, 1e100, 1e308, 1.7976931348623157e308, math.inf, math.nan)
VALUES = st.one_of(st.sampled_from((*ENDS, *(-end for end in ENDS), 80.0)), st.floats())
STEPS_S = st.one_of(st.sampled_from((0.0, 5e-324, 2.2e-313, 1e-9, 1.0, -5.0, 3e8, -3e8, 9e10, 1e308)), st.floats())
ROWS = st.lists(st.tuples(st.integers(0, 8), st.sampled_from((0.0, 0.0, 5e-324, 0.5)), VALUES), max_size=8)


@cache
def soon_learnt() -> bytes:
    """Three robots that are alike, of which all is learned that there is to learn."""
    made = Robots(Evaluator(SOON), count=3)
    for name in made.names:
        made.evaluator.robot(name, "alike")
    made.run(40)
    return made.evaluator.dump()


@settings(max_examples=12)
@given(
    st.lists(st.tuples(st.booleans(), STEPS_S, ROWS, st.dictionaries(st.sampled_from("ab"), VALUES)), min_size=6),
    st.booleans(),
)
def test_whatever_numbers_robots_send_findings_and_bands_are_numbers(
    seconds: list[tuple[bool, float, list[tuple[int, float, float]], dict[str, float]]], teach: bool
) -> None:
    evaluator, at_s = Evaluator.load(soon_learnt(), SOON), 1e9 + 40.0
    for plain, step_s, rows, rates in seconds:
        at_s += 1.0 if plain else step_s
        at_s = at_s if abs(at_s) < 2e11 else 1e9
        places, shifts, values = zip(*rows, strict=True) if rows else ((), (), ())
        evaluator.samples(np.array(places, np.int64), at_s + np.array(shifts), np.array(values))
        evaluator.rates("r0", rates, at_s)
        for finding in (edge.finding for edge in evaluator.tick(at_s + 1.0)):
            assert 0.0 <= finding.score <= 1.0
            assert math.isfinite(finding.value)
            if teach:
                evaluator.accept(finding.robot, finding.series, finding.kind, finding.value)
    for slot in range(9):
        low, high = evaluator.band(slot)
        assert -math.inf < low <= high < math.inf
        assert 0.0 <= evaluator.score(slot) <= 1.0
        evaluator.learned(slot)
    assert repr(Evaluator.load(evaluator.dump(), SOON).open()) == repr(
        evaluator.open()
    )  # a bound may be a NaN: there is none


def test_a_forgotten_robot_leaves_its_numbers_to_the_next(robots: Robots) -> None:
    robots.offset[1] = 3.0
    robots.run(10)
    robots.evaluator.forget("r0")
    assert (robots.evaluator.open(), robots.evaluator.robots(), robots.evaluator.find("r0", WAVE)) == ([], [], -1)
    fresh = Robots(robots.evaluator)
    assert fresh.run(80) == []
    assert fresh.evaluator.learned(int(fresh.slots[0, 0])).seen == 79


def test_bounds_are_kept_and_counted() -> None:
    evaluator = Evaluator(EvaluatorConfig(slots=2, robots=1))
    assert [evaluator.slot("r", name) for name in ("a", "b", "c", "a")] == [0, 1, -1, 0]
    assert evaluator.slot("q", "a") == -1
    assert evaluator.refused == 2


def test_a_check_that_is_switched_off_clears_what_it_reported(robots: Robots) -> None:
    robots.offset[0] = 50.0
    robots.run(12)
    kept = [check for check in DEFAULT_CHECKS if check.kind != "threshold"]
    robots.evaluator.set_checks(kept)
    cleared = {edge.finding.kind for edge in robots.evaluator.tick(1e9 + robots.second) if edge.change == "cleared"}
    assert "motor_hot" in cleared
    robots.evaluator.set_checks(DEFAULT_CHECKS)
    assert "motor_hot" in {edge.finding.kind for edge in robots.run(12) if edge.change == "opened"}
