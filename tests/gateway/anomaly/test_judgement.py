"""Everything together: what a robot does becomes findings with names, bands and reasons."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gateway.anomaly.bank import SnapshotError
from gateway.anomaly.defaults import DEFAULT_CHECKS
from gateway.anomaly.judgement import Judge, JudgeConfig
from gateway.anomaly.lasting import LastingConfig
from gateway.domain.finding import Edge

CONFIG = JudgeConfig(lasting=LastingConfig(learn_s=600, epoch_s=300))
LEARN_S = 900
MOTOR, WAVE, CALM = "left.motor_temperature.temperature", "imu.angular_velocity.z", "odom.twist.twist.linear.x"
TOPICS = {MOTOR: "/left/motor_temperature", WAVE: "/imu", CALM: "/odom"}


class Robots:
    """Some robots with three series each, at 10 Hz."""

    def __init__(self, judge: Judge, count: int = 1) -> None:
        self.judge, self.rng, self.second = judge, np.random.default_rng(8), 0
        self.names = [f"r{n}" for n in range(count)]
        self.slots = np.array([[judge.slot(name, series, TOPICS[series]) for series in TOPICS] for name in self.names])
        self.offset = np.zeros(3)

    def run(self, seconds: int, *, silent: str = "") -> list[Edge]:
        edges = []
        for _ in range(seconds):
            at_s = 1e9 + self.second
            values = np.array((40.0, 0.0, 0.5)) + 0.3 * self.rng.normal(size=(10, len(self.names), 3)) + self.offset
            stamps = np.broadcast_to((at_s + 0.05 + 0.1 * np.arange(10))[:, None, None], values.shape)
            there = np.array([series != silent for series in TOPICS])
            slots = np.broadcast_to(self.slots, values.shape)
            self.judge.samples(slots[..., there].ravel(), stamps[..., there].ravel(), values[..., there].ravel())
            for name in self.names:
                self.judge.heard(name, at_s + 1.0)
            edges += self.judge.tick(at_s + 1.0)
            self.second += 1
        return edges


@pytest.fixture(scope="module")
def learnt() -> bytes:
    made = Robots(Judge(CONFIG))
    assert made.run(LEARN_S) == []
    return made.judge.dump()


@pytest.fixture
def robots(learnt: bytes) -> Robots:
    made = Robots(Judge.load(learnt, CONFIG))
    made.rng, made.second = np.random.default_rng(9), LEARN_S
    return made


def test_a_hot_motor_is_told_with_its_band_and_reason_and_clears_by_itself(robots: Robots) -> None:
    robots.offset[0] = 50.0
    edges = {edge.finding.kind: edge.finding for edge in robots.run(12)}
    hot = edges["motor_hot"]
    assert (hot.robot, hot.series, hot.cause, hot.severity, hot.high) == ("r0", MOTOR, "heat", "warning", 80.0)
    assert hot.value > 80.0
    assert "above 80 °C for 5 s" in hot.reason
    assert 0.5 <= hot.score <= 1.0
    assert {finding.kind for finding in robots.judge.open("r0")} >= {"motor_hot"}
    robots.offset[0] = 0.0
    while robots.judge.open():
        robots.run(20)
        assert robots.second < LEARN_S + 1200


def test_another_level_is_told_with_where_it_was_expected(robots: Robots) -> None:
    robots.offset[1] = 3.0
    edge = next(edge for edge in robots.run(12) if edge.finding.kind == "level")
    assert (edge.change, edge.finding.series) == ("opened", WAVE)
    assert edge.finding.low < 0.0 < edge.finding.high < 3.0
    assert "expected" in edge.finding.reason
    low, high = robots.judge.band(robots.judge.find("r0", WAVE))
    assert low < 0.0 < high


def test_a_silent_topic_is_told_by_the_other_ones_and_offline_by_the_gateways_clock(robots: Robots) -> None:
    silence = [edge.finding for edge in robots.run(6, silent=CALM) if edge.finding.kind == "silence"]
    assert [(found.series, found.cause) for found in silence] == [("/odom", "silence")]
    robots.run(20)
    edges = robots.judge.tick(1e9 + robots.second + 40.0)
    assert [(edge.finding.kind, edge.finding.severity) for edge in edges] == [("offline", "error")]


def test_this_is_normal_closes_a_finding_and_is_remembered(robots: Robots) -> None:
    robots.offset[1] = 3.0
    robots.run(30)
    assert any(finding.series == WAVE for finding in robots.judge.open("r0"))
    for value in (3.0, 4.2, 1.8):
        robots.judge.accept("r0", WAVE, "level", value)
    robots.judge.accept("r0", "nothing", "level", 1.0)
    robots.judge.accept("r0", WAVE, "level", math.nan)
    assert {edge.change for edge in robots.judge.tick(1e9 + robots.second)} == {"cleared"}
    assert [
        edge for edge in robots.run(30) if edge.finding.kind in ("level", "novelty") and edge.change == "opened"
    ] == []


def test_rates_from_the_robot_are_judged_like_topics() -> None:
    judge, found = Judge(CONFIG), []
    for second in range(400):
        hz = 50.0 if second < 300 else 15.0
        rates = {"/scan": 10.0} if second >= 350 else {"/scan": 10.0, "/camera/image": hz}
        judge.rates("r", rates, 1e9 + second)
        found += [(second, edge.finding.series, edge.finding.kind) for edge in judge.tick(1e9 + second)]
    assert [row[1:] for row in found] == [("/camera/image", "rate_low")]
    assert found[0][0] <= 305


def test_a_restart_goes_on_to_the_last_bit(robots: Robots) -> None:
    robots.judge.samples(np.array([0]), np.array([1e9 + robots.second + 0.01]), np.array([41.0]))
    data = robots.judge.dump()
    other = Robots(Judge.load(data, CONFIG))
    other.rng, other.second = np.random.default_rng(77), robots.second
    robots.rng = np.random.default_rng(77)
    robots.offset[1] = other.offset[1] = 3.0
    assert other.run(60) == robots.run(60) != []
    assert other.judge.dump() == robots.judge.dump()


def test_a_damaged_snapshot_is_refused(robots: Robots) -> None:
    whole = robots.judge.dump()
    for damaged in (whole[: len(whole) // 2], b"", b"x" * 1000):
        with pytest.raises(SnapshotError):
            Judge.load(damaged, CONFIG)


def test_a_snapshot_of_other_parameters_is_refused(robots: Robots) -> None:
    with pytest.raises(SnapshotError, match="parameter"):
        Judge.load(robots.judge.dump())


def test_junk_years_and_clocks_that_jump_are_no_storm(robots: Robots) -> None:
    slots = robots.slots.ravel()
    for value in (math.nan, math.inf, -math.inf):
        robots.judge.samples(slots, np.full(3, 1e9 + robots.second), np.full(3, value))
    robots.judge.samples(slots, np.full(3, math.nan), np.zeros(3))
    for jump_s in (315_000_000, -315_000_000, 86_400):
        robots.second += jump_s
        assert [edge for edge in robots.run(30) if edge.finding.kind not in ("behind", "ahead")] == []


def test_a_forgotten_robot_leaves_its_numbers_to_the_next(robots: Robots) -> None:
    robots.offset[1] = 3.0
    robots.run(10)
    robots.judge.forget("r0")
    assert (robots.judge.open(), robots.judge.robots(), robots.judge.find("r0", WAVE)) == ([], [], -1)
    fresh = Robots(robots.judge)
    assert fresh.run(150) == []
    assert fresh.judge.learned(int(fresh.slots[0, 0])).seen == 149


def test_bounds_are_kept_and_counted() -> None:
    judge = Judge(JudgeConfig(slots=2, robots=1))
    assert [judge.slot("r", name) for name in ("a", "b", "c", "a")] == [0, 1, -1, 0]
    assert judge.slot("q", "a") == -1
    assert judge.refused == 2


def test_a_check_that_is_switched_off_clears_what_it_told(robots: Robots) -> None:
    robots.offset[0] = 50.0
    robots.run(12)
    kept = [check for check in DEFAULT_CHECKS if check.kind != "threshold"]
    robots.judge.set_checks(kept)
    cleared = {edge.finding.kind for edge in robots.judge.tick(1e9 + robots.second) if edge.change == "cleared"}
    assert "motor_hot" in cleared
    robots.judge.set_checks(DEFAULT_CHECKS)
    assert "motor_hot" in {edge.finding.kind for edge in robots.run(12) if edge.change == "opened"}
