"""Names and their numbers, within bounds."""

from __future__ import annotations

from gateway.anomaly.judgement import NAMED, Judge, JudgeConfig
from gateway.anomaly.register import Register


def test_no_robot_takes_all_slots() -> None:
    register = Register(slots=10, robots=2, slots_of_robot=3)
    greedy, modest = register.robot("greedy"), register.robot("modest")
    assert greedy is not None
    assert modest is not None
    assert [register.slot("greedy", greedy, f"s{n}", "t") for n in range(5)] == [0, 1, 2, -1, -1]
    assert register.slot("modest", modest, "s", "t") == 3
    register.forget("greedy")
    assert register.robot("another") is not None


def test_topics_that_a_robot_names_anew_each_second_are_bounded() -> None:
    judge = Judge(JudgeConfig(slots=100, slots_of_robot=4))
    for second in range(5):
        judge.rates("r1", {f"/{second}/{n}": 1.0 for n in range(NAMED // 2)}, 1000.0 + second)
        judge.tick(1000.0 + second)
    assert len(judge.series("r1")) == 4
    words = sum(len(named) for named in judge._named.values())
    assert words == NAMED
