"""Topics that fall silent, and those that slow down."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

from gateway.alerting.anomaly.detectors.presence import Presence, PresenceConfig
from gateway.alerting.anomaly.detectors.rates import RateConfig
from tests.gateway.alerting.anomaly.cellfeed import second


class Robot:
    """Two topics of one robot, of which the first tells what the second is held against."""

    def __init__(self, **rates: int) -> None:
        self.presence = Presence(PresenceConfig(), RateConfig(**rates))
        for columns in self.presence.parts.values():
            columns.grow(2)
        self.presence.robots.grow(1)
        self.presence.topics["robot"][:2] = 0
        self.at_s = 1000.0

    def run(self, seconds: int, *, there: bool = True, count: int = 10) -> list[tuple[str, float, bool]]:
        """Edges of the second topic: what, after how many seconds, and whether it opened."""
        found = []
        for n in range(seconds):
            slots = [0, 1] if there else [0]
            cell = second(self.at_s, [1.0] * len(slots), slots=slots, count=10)
            cell.count[-1] = count if there else 10
            verdicts = self.presence.feed(cell, np.array(slots), np.array([0]))
            for word, verdict in zip(("silence", "low", "high"), verdicts, strict=True):
                found += [(word, float(n), bool(opened)) for opened in verdict.opened]
            self.at_s += 1.0
        return found


@pytest.fixture(scope="module")
def learnt() -> Robot:
    made = Robot()
    assert made.run(300) == []
    return made


@pytest.fixture
def robot(learnt: Robot) -> Robot:
    return deepcopy(learnt)


def test_a_topic_of_ten_hertz_is_silent_after_three_seconds_and_comes_back(robot: Robot) -> None:
    assert robot.run(10, there=False) == [("silence", 2.0, True)]
    assert robot.run(3)[0] == ("silence", 0.0, False)


def test_a_topic_with_long_pauses_gets_a_later_deadline(robot: Robot) -> None:
    for _ in range(3):
        robot.run(2, there=False)
        robot.run(60)
    assert robot.presence.deadline_s(np.array([1]))[0] > 5.0
    assert [edge for edge in robot.run(8, there=False) if edge[0] == "silence"] == [("silence", 5.0, True)]


def test_a_slower_and_a_faster_topic_are_reported_within_five_seconds(robot: Robot) -> None:
    assert robot.run(10, count=3) == [("low", 3.0, True)]
    assert robot.run(30)[0][0] == "low"
    assert robot.run(10, count=30)[0] == ("high", 2.0, True)


def test_after_a_pause_of_the_whole_robot_topics_have_a_grace(robot: Robot) -> None:
    robot.at_s += 3600.0
    assert robot.run(40, there=False) == []
    assert [edge[0] for edge in robot.run(20, there=False)] == ["silence"]


def test_years_of_nothing_and_a_clock_set_back_tell_nothing(robot: Robot) -> None:
    robot.at_s += 3e8
    assert robot.run(100) == []
    robot.at_s = 500.0
    assert robot.run(100) == []


def test_a_topic_that_is_never_steady_has_no_rate() -> None:
    robot, rng = Robot(), np.random.default_rng(1)
    assert [edge for _ in range(600) for edge in robot.run(1, count=int(rng.choice((1, 20))))] == []


def test_a_new_rate_is_usual_after_hours() -> None:
    """An hour is six minutes here, as a tenth of the time is remembered."""
    robot = Robot(memory=RateConfig().memory // 10)
    robot.run(180)
    edges = robot.run(520, count=3)
    assert [(word, opened) for word, _, opened in edges] == [("low", True), ("low", False)]
    assert edges[1][1] > 360.0
