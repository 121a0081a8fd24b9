"""More is told at once, less only after a while."""

from __future__ import annotations

from gateway.live.demand import DemandTable, merge_rates


def test_the_highest_rate_serves_all_and_zero_is_everything() -> None:
    assert merge_rates([1, 10, 5]) == 10
    assert merge_rates([10, 0]) == 0
    assert merge_rates([]) == 0


def test_reported_once() -> None:
    registry = DemandTable()
    registry.want("r", {"/odom": 10}, now_s=0)
    assert registry.due("r", now_s=0) == {"/odom": 10}
    assert registry.due("r", now_s=0) is None
    registry.want("r", {"/odom": 10, "/scan": 0}, now_s=1)
    assert registry.due("r", now_s=1) == {"/odom": 10, "/scan": 0}
    assert registry.sent("r") == {"/odom": 10, "/scan": 0}


def test_released_after_two_seconds() -> None:
    registry = DemandTable(hold_s=2)
    registry.want("r", {"/odom": 10}, now_s=0)
    registry.due("r", now_s=0)
    registry.want("r", {}, now_s=5)
    assert registry.due("r", now_s=6.9) is None
    assert registry.releasing() == {"r"}
    assert registry.due("r", now_s=7) == {}
    assert registry.releasing() == set()


def test_a_reload_costs_nothing() -> None:
    registry = DemandTable(hold_s=2)
    registry.want("r", {"/odom": 10}, now_s=0)
    registry.due("r", now_s=0)
    registry.want("r", {}, now_s=5)
    assert registry.due("r", now_s=5) is None
    registry.want("r", {"/odom": 10}, now_s=6)
    assert registry.due("r", now_s=60) is None


def test_less_rate_is_held_and_more_is_not() -> None:
    registry = DemandTable(hold_s=2)
    registry.want("r", {"/odom": 0}, now_s=0)
    registry.due("r", now_s=0)
    registry.want("r", {"/odom": 5}, now_s=1)
    assert registry.due("r", now_s=2) is None
    assert registry.due("r", now_s=3) == {"/odom": 5}
    registry.want("r", {"/odom": 20}, now_s=3)
    assert registry.due("r", now_s=3) == {"/odom": 20}


def test_a_new_link_was_reported_nothing() -> None:
    registry = DemandTable()
    registry.want("r", {"/odom": 10}, now_s=0)
    registry.due("r", now_s=0)
    registry.forget("r")
    assert registry.sent("r") == {}
    assert registry.due("r", now_s=0) == {"/odom": 10}
