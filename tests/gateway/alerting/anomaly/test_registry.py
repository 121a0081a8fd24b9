"""Names and their numbers, within bounds."""

from __future__ import annotations

from gateway.alerting.anomaly.evaluator import NAMED, Evaluator, EvaluatorConfig
from gateway.alerting.anomaly.registry import SeriesRegistry


def test_no_robot_takes_all_slots() -> None:
    registry = SeriesRegistry(slots=10, robots=2, slots_of_robot=3)
    greedy, modest = registry.robot("greedy"), registry.robot("modest")
    assert greedy is not None
    assert modest is not None
    assert [registry.slot("greedy", greedy, f"s{n}", "t") for n in range(5)] == [0, 1, 2, -1, -1]
    assert registry.slot("modest", modest, "s", "t") == 3
    registry.forget("greedy")
    assert registry.robot("another") is not None


def test_topics_that_a_robot_names_anew_each_second_are_bounded() -> None:
    evaluator = Evaluator(EvaluatorConfig(slots=100, slots_of_robot=4))
    for second in range(5):
        evaluator.rates("r1", {f"/{second}/{n}": 1.0 for n in range(NAMED // 2)}, 1000.0 + second)
        evaluator.tick(1000.0 + second)
    assert len(evaluator.series("r1")) == 4
    words = sum(len(named) for named in evaluator._named.values())
    assert words == NAMED
