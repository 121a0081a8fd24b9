"""Which messages count: patterns, conditions with a memory, timers; and what a new life remembers."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from metaros.automation.robot.backlog import Backlog, NewEvent
from metaros.automation.robot.evaluator import Evaluator, Verdict
from metaros.automation.robot.event import ReceivedMessage, event_of
from metaros.automation.robot.manifest import Trigger, parse_function
from metaros.limits import LIMITS

SECOND = 10**9


def trigger(**options: Any) -> Trigger:
    row = {"name": "t", "topic": "level", **options}
    return parse_function(json.dumps({"name": "f", "handler": "a.b", "triggers": [row]})).triggers[0]


def event(seq: int, value: float) -> dict[str, Any]:
    received = ReceivedMessage(
        topic="/r/level", type="a/msg/B", stamp_ns=seq, seq=seq, gid=b"\x01", message={"value": value}
    )
    return event_of(received, robot="r")


def names(verdict: Verdict) -> list[str]:
    return [put.name for put in verdict.puts]


LOW = {"detail": {"message": {"value": [{"numeric": ["<", 0.2]}]}}}


def test_what_matches_counts() -> None:
    watch = trigger(pattern=LOW)
    evaluator = Evaluator([watch])
    assert names(evaluator.evaluate(watch, event(1, 0.5), 0)) == []
    assert names(evaluator.evaluate(watch, event(2, 0.1), 0)) == ["r/r/level/01/2"]


def test_a_condition_that_lasts_acts_by_its_timer_with_the_last_event() -> None:
    watch = trigger(pattern=LOW, when={"for": "5s"})
    evaluator = Evaluator([watch])
    for seq in range(1, 5):
        assert names(evaluator.evaluate(watch, event(seq, 0.1), seq * SECOND)) == []
    assert evaluator.next_ns() == 6 * SECOND
    rung = evaluator.elapse(6 * SECOND)
    assert names(rung) == [f"r/r/level/01/4@{6 * SECOND}"]
    assert json.loads(rung.puts[0].payload)["detail"]["seq"] == 4
    assert evaluator.next_ns() is None


@pytest.mark.parametrize("value", [0.1, 0.9])
def test_a_new_life_goes_on_with_what_the_old_one_remembered(tmp_path: Path, value: float) -> None:
    watch = trigger(pattern=LOW, when={"for": "5s", "edge": "both"})
    backlog = Backlog(tmp_path / "b")
    verdict = Evaluator([watch]).evaluate(watch, event(1, 0.1), SECOND)
    backlog.keep(verdict.puts, verdict.condition_states)
    backlog.close()

    backlog = Backlog(tmp_path / "b")
    evaluator = Evaluator([watch], backlog.condition_states())
    assert evaluator.next_ns() == 6 * SECOND
    evaluator.evaluate(watch, event(2, value), 2 * SECOND)
    assert len(names(evaluator.elapse(7 * SECOND))) == (1 if value < 0.2 else 0)
    backlog.close()


def test_of_too_many_groups_the_longest_unseen_goes() -> None:
    watch = trigger(when={"cooldown": "1h", "group_by": "detail.message.value"})
    evaluator = Evaluator([watch], limits=dataclasses.replace(LIMITS, robot_groups=2))
    for seq in range(3):
        last = evaluator.evaluate(watch, event(seq, float(seq)), SECOND)
    assert [(one.part, one.state) for one in last.condition_states if not one.state] == [("0.0", "")]
    assert names(evaluator.evaluate(watch, event(3, 1.0), SECOND)) == []  # it is remembered
    assert names(evaluator.evaluate(watch, event(4, 0.0), SECOND)) != []  # it is not


def test_the_backlog_is_bounded_and_keeps_what_is_put_twice_once(tmp_path: Path) -> None:
    limits = dataclasses.replace(LIMITS, robot_events=3, robot_dead_letters=1, robot_results=2)
    backlog = Backlog(tmp_path / "b", limits=limits)
    puts = [NewEvent(trigger="t", name=str(number), payload=b"{}", at_ns=number) for number in (1, 1, 2, 3, 4)]
    assert backlog.keep(puts, []) == 3
    assert backlog.refused == 1
    first, second, third = backlog.lease(10, now_ns=10)
    assert [first.name, second.name, third.name] == ["1", "2", "3"]
    backlog.settle(first, {"n": 1}, dead="broken")
    backlog.settle(second, {"n": 2}, dead="broken")
    backlog.settle(third, {"n": 3}, again_ns=50)
    counts = backlog.counts()
    assert (counts.waiting, counts.under_way, counts.dead, counts.unsent) == (1, 0, 1, 2)
    assert backlog.lease(10, now_ns=49) == []
    assert backlog.redrive(now_ns=20) == 1
    assert [one.name for one in backlog.lease(10, now_ns=50)] == ["2", "3"]
    backlog.close()

    backlog = Backlog(tmp_path / "b", limits=limits)
    assert backlog.recover() == 2  # nobody knows how they ended
    assert [one.losses for one in backlog.lease(10, now_ns=50)] == [1, 1]
    backlog.close()


def test_what_was_handed_over_lately_is_so_again(tmp_path: Path) -> None:
    backlog = Backlog(tmp_path / "b")
    backlog.keep([NewEvent(trigger="t", name=str(number), payload=b"{}", at_ns=0) for number in range(2)], [])
    for one in backlog.lease(2, now_ns=0):
        backlog.settle(one, {"n": one.name})
    old, new = backlog.unsent(10)
    backlog.sent([old], now_ns=100)
    backlog.sent([new], now_ns=200)
    assert backlog.unsent(10) == []
    assert backlog.send_again(since_ns=150) == 1
    assert backlog.unsent(10) == [new]
    backlog.close()
