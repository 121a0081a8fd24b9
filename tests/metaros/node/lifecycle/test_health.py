"""Health rules under a manual clock: hysteresis, back-off, what is decided, in which words."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.clock import ManualClock
from metaros.errors import UsageError
from metaros.node.lifecycle.health import Health, Mode
from metaros.node.lifecycle.health_rules import Action, Decision, HealthRule, Step
from metaros.node.lifecycle.signals import (
    CallbackOverrun,
    CpuPercent,
    DeadlineMissed,
    ErrorCount,
    Signal,
    Temperature,
    TopicRate,
)

RATE = TopicRate("/scan", below_hz=5)
STEP_S = 0.1


class Bench:
    """Health with a node that does as it is told; `runs` drives it for a while with one reading."""

    def __init__(self, *rules: HealthRule, obeys: Callable[[Decision], bool] = lambda decision: True) -> None:
        self.clock = ManualClock()
        self.health = Health(rules, now_s=self.clock.monotonic_s(), grace_s=0.0)
        self.active = True
        self.obeys = obeys
        self.log: list[tuple[float, Decision]] = []

    def runs(self, seconds: float, value: float | None) -> list[Step]:
        """The steps decided meanwhile."""
        steps = []
        for _ in range(round(seconds / STEP_S)):
            self.clock.advance(STEP_S)
            now_s = self.clock.monotonic_s()
            readings = {state.rule.signal.key: value for state in self.health.rules}
            for decision in self.health.step(now_s, readings, active=self.active):
                self.log.append((round(now_s - 1000.0, 6), decision))
                steps.append(decision.step)
                if decision.step not in (Step.DEGRADE, Step.RESTORE):
                    if self.obeys(decision):
                        self.active = decision.step is not Step.DEACTIVATE
                    elif decision.step is not Step.DEACTIVATE:
                        self.active = False
                    self.health.carried_out(now_s, decision, active=self.active)
        return steps


def test_degrades_after_so_long_and_recovers_after_so_long() -> None:
    bench = Bench(HealthRule("lidar", RATE, for_s=1.0, clear_for_s=2.0))
    assert bench.runs(5.0, 10.0) == []
    assert bench.runs(1.0, 2.0) == []
    assert bench.runs(0.2, 2.0) == [Step.DEGRADE]
    assert bench.health.mode is Mode.DEGRADED
    assert bench.runs(10.0, 2.0) == []
    assert bench.runs(2.0, 10.0) == []
    assert bench.runs(0.2, 10.0) == [Step.RESTORE]
    assert bench.health.mode is Mode.HEALTHY
    texts = [str(decision) for _, decision in bench.log]
    assert texts[0] == "degraded (lidar): /scan comes at 2.0 Hz (wanted: 5 Hz) for 1 s"
    assert texts[1].startswith("recovered (lidar): /scan comes at 10.0 Hz (wanted: 5 Hz) for 2 s; it lasted 12.")
    assert bench.log[0][1].facts == {"signal": RATE.key, "value": "2", "for_s": "1", "relapses": "0"}


def test_a_break_begins_the_time_anew_and_the_band_decides_nothing() -> None:
    bench = Bench(HealthRule("lidar", RATE, for_s=1.0, clear_for_s=2.0))
    for _ in range(20):
        assert bench.runs(0.9, 2.0) == []
        assert bench.runs(0.1, 5.2) == []
    assert bench.runs(2.0, 4.9) == [Step.DEGRADE]
    assert bench.runs(20.0, 5.2) == []
    assert bench.health.mode is Mode.DEGRADED


def test_without_readings_nothing_changes() -> None:
    bench = Bench(HealthRule("lidar", RATE))
    assert bench.runs(20.0, None) == []
    bench.runs(2.0, 0.0)
    assert bench.runs(20.0, None) == []
    assert bench.health.mode is Mode.DEGRADED
    assert bench.health.rules[0].describe() == "not measured"


def test_a_time_without_steps_is_no_evidence() -> None:
    bench = Bench(HealthRule("lidar", RATE, for_s=3.0))
    bench.runs(0.1, 2.0)
    bench.clock.advance(60.0)
    assert bench.runs(0.1, 2.0) == []


def test_each_relapse_doubles_the_time_to_recover_until_forgotten() -> None:
    bench = Bench(HealthRule("lidar", RATE, clear_for_s=2.0, clear_max_s=10.0, forget_s=60.0))
    taken = []
    for _ in range(5):
        assert bench.runs(1.5, 2.0) == [Step.DEGRADE]
        bench.runs(15.0, 10.0)
        taken.append(bench.log[-1][1].facts["clear_for_s"])
    assert taken == ["2", "4", "8", "10", "10"]
    bench.runs(61.0, 10.0)
    bench.runs(1.5, 2.0)
    bench.runs(15.0, 10.0)
    assert bench.log[-1][1].facts["clear_for_s"] == "2"


def test_several_rules_degrade_together_and_recover_together() -> None:
    cpu = HealthRule("cpu", CpuPercent(above=90))
    bench = Bench(HealthRule("lidar", RATE), cpu)
    health, now_s = bench.health, bench.clock.monotonic_s()
    steps = []
    for number in range(200):
        seconds = number * STEP_S
        readings = {RATE.key: 1.0 if 1 < seconds < 10 else 9.0, "cpu process": 99.0 if 5 < seconds < 14 else 20.0}
        steps += [(round(seconds), d.step, d.rule) for d in health.step(now_s + seconds, readings, active=True)]
    assert steps == [(2, Step.DEGRADE, "lidar"), (6, Step.DEGRADE, "cpu"), (16, Step.RESTORE, "cpu")]


def test_deactivates_until_it_is_good_again() -> None:
    bench = Bench(HealthRule("motor", Temperature("motor", above_c=80), action=Action.DEACTIVATE, clear_for_s=2.0))
    assert bench.runs(2.0, 85.0) == [Step.DEACTIVATE]
    assert bench.health.mode is Mode.DOWN
    assert bench.runs(10.0, 78.0) == []
    assert bench.runs(3.0, 70.0) == [Step.REACTIVATE]
    assert (bench.health.mode, bench.active) == (Mode.HEALTHY, True)
    assert str(bench.log[0][1]) == "deactivating (motor): motor is at 85.0 °C (allowed: 80 °C) for 1 s"
    assert str(bench.log[1][1]) == "reactivating (motor): motor is at 70.0 °C (allowed: 80 °C)"


def test_a_node_that_will_not_come_up_is_asked_less_and_less_often() -> None:
    rule = HealthRule("motor", Temperature("motor", above_c=80), action=Action.DEACTIVATE)
    bench = Bench(rule, obeys=lambda decision: decision.step is Step.DEACTIVATE)
    bench.runs(2.0, 85.0)
    steps = bench.runs(100.0, 60.0)
    assert steps == [Step.REACTIVATE] * 5
    times = [at for at, _ in bench.log[1:]]
    assert [round(b - a) for a, b in itertools.pairwise(times)] == [5, 10, 20, 40]
    assert "attempt 5" in bench.log[-1][1].reason


@pytest.mark.parametrize(("action", "step"), [(Action.RECOVER, Step.RECOVER), (Action.RESTART, Step.RESTART)])
def test_cycles_with_back_off_then_holds_the_node_down(action: Action, step: Step) -> None:
    bench = Bench(HealthRule("lidar", RATE, action=action, retry_s=5.0, tries=3))
    assert bench.runs(1.2, 0.0) == [step]
    assert bench.runs(60.0, 0.0) == [step, step, Step.DEACTIVATE]
    times = [at for at, _ in bench.log]
    assert [round(b - a) for a, b in itertools.pairwise(times)] == [5, 10, 20]
    assert "attempt 2 of 3, the next in 10 s" in bench.log[1][1].reason
    assert "3 attempts did not help" in bench.log[3][1].reason
    assert bench.health.mode is Mode.DOWN
    assert bench.runs(10.0, 10.0) == [Step.REACTIVATE]


def test_a_cycle_that_helps_is_the_only_one() -> None:
    bench = Bench(HealthRule("lidar", RATE, action=Action.RESTART))
    assert bench.runs(1.2, 0.0) == [Step.RESTART]
    assert bench.runs(60.0, 10.0) == []
    assert not bench.health.rules[0].tripped


def test_a_cycle_that_fails_is_brought_up_later() -> None:
    answers = iter([False, True])
    bench = Bench(HealthRule("lidar", RATE, action=Action.RESTART), obeys=lambda decision: next(answers))
    assert bench.runs(1.2, 0.0) == [Step.RESTART]
    assert bench.health.mode is Mode.DOWN
    assert bench.runs(6.0, 10.0) == [Step.REACTIVATE]
    assert bench.active


def test_a_deactivation_that_fails_is_tried_again() -> None:
    answers = iter([False, True])
    bench = Bench(HealthRule("lidar", RATE, action=Action.DEACTIVATE), obeys=lambda decision: next(answers))
    assert bench.runs(1.2, 0.0) == [Step.DEACTIVATE]
    assert bench.active
    assert bench.runs(6.0, 0.0) == [Step.DEACTIVATE]
    assert not bench.active


def test_an_inactive_node_is_left_alone_and_a_reset_begins_anew() -> None:
    bench = Bench(HealthRule("lidar", RATE, action=Action.DEACTIVATE))
    bench.active = False
    assert bench.runs(10.0, 0.0) == []
    bench.active = True
    assert bench.runs(2.0, 0.0) == [Step.DEACTIVATE]
    bench.health.reset(bench.clock.monotonic_s())  # an operator deactivated it: it is not brought up
    assert bench.health.mode is Mode.HEALTHY
    assert bench.runs(20.0, 10.0) == []


def test_nothing_is_judged_for_a_while_after_a_change_of_state() -> None:
    health = Health([HealthRule("lidar", RATE, for_s=0.0)], now_s=0.0, grace_s=2.0)
    health.reset(10.0)
    assert health.step(11.9, {RATE.key: 0.0}, active=True) == []
    assert [decision.step for decision in health.step(12.0, {RATE.key: 0.0}, active=True)] == [Step.DEGRADE]


@pytest.mark.parametrize(
    ("signal", "bad", "neither", "good", "text"),
    [
        (RATE, 4.9, 6.2, 6.25, "/scan comes at 4.9 Hz (wanted: 5 Hz)"),
        (TopicRate("/scan", below_hz=5, clear_hz=8), 4.9, 7.9, 8.0, "/scan comes at 4.9 Hz (wanted: 5 Hz)"),
        (
            DeadlineMissed("/scan", deadline_s=0.2, at_least=3),
            3,
            2,
            0,
            "/scan missed its deadline of 0.2 s 3× in 5 s",
        ),
        (CallbackOverrun(over_s=0.1), 0.11, 0.09, 0.08, "a callback took up to 110 ms (allowed: 100 ms)"),
        (ErrorCount(at_least=3), 3, 1, 0, "errors in 10 s: 3 (allowed: 2)"),
        (CpuPercent(above=90, of="host"), 91, 85, 81, "the host takes 91 % CPU (allowed: 90 %)"),
        (Temperature("motor", above_c=80), 81, 76, 75, "motor is at 81.0 °C (allowed: 80 °C)"),
    ],
)
def test_signals(signal: Signal, bad: float, neither: float, good: float, text: str) -> None:
    assert (signal.bad(bad), signal.good(bad)) == (True, False)
    assert (signal.bad(neither), signal.good(neither)) == (False, False)
    assert (signal.bad(good), signal.good(good)) == (False, True)
    assert signal.describe(bad) == text


def test_rules_that_cannot_be() -> None:
    with pytest.raises(UsageError, match="names of their own"):
        Health([HealthRule("a", RATE), HealthRule("a", RATE)], now_s=0.0)
    with pytest.raises(UsageError, match="'a': no time may be negative"):
        HealthRule("a", RATE, for_s=-1.0)
    with pytest.raises(UsageError, match="backoff and tries"):
        HealthRule("a", RATE, tries=0)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.sampled_from([0.0, 5.2, 10.0, None]), st.integers(1, 80)), min_size=5, max_size=60))
def test_no_input_whatever_makes_it_flap(stretches: list[tuple[float | None, int]]) -> None:
    """Relapses double the way back: at most six degradations in any minute, however nasty the signal."""
    bench = Bench(HealthRule("lidar", RATE, for_s=1.0, clear_for_s=2.0))
    for value, steps in stretches:
        bench.runs(steps * STEP_S, value)
    changes = [decision.step for _, decision in bench.log]
    assert changes == [Step.DEGRADE, Step.RESTORE] * (len(changes) // 2) + [Step.DEGRADE] * (len(changes) % 2)
    times = [at for at, decision in bench.log if decision.step is Step.DEGRADE]
    assert all(sum(start <= at < start + 60 for at in times) <= 6 for start in times)
    for (first, one), (second, _) in zip(bench.log, bench.log[1:], strict=False):
        assert second - first >= (2.0 if one.step is Step.DEGRADE else 1.0) - 1e-6
