"""More is told at once, less only after a while."""

from __future__ import annotations

from gateway.live.demand import DemandBook, merge_rates


def test_the_highest_rate_serves_all_and_zero_is_everything() -> None:
    assert merge_rates([1, 10, 5]) == 10
    assert merge_rates([10, 0]) == 0
    assert merge_rates([]) == 0


def test_told_once() -> None:
    book = DemandBook()
    book.want("r", {"/odom": 10}, now_s=0)
    assert book.due("r", now_s=0) == {"/odom": 10}
    assert book.due("r", now_s=0) is None
    book.want("r", {"/odom": 10, "/scan": 0}, now_s=1)
    assert book.due("r", now_s=1) == {"/odom": 10, "/scan": 0}
    assert book.told("r") == {"/odom": 10, "/scan": 0}


def test_released_after_two_seconds() -> None:
    book = DemandBook(hold_s=2)
    book.want("r", {"/odom": 10}, now_s=0)
    book.due("r", now_s=0)
    book.want("r", {}, now_s=5)
    assert book.due("r", now_s=6.9) is None
    assert book.releasing() == {"r"}
    assert book.due("r", now_s=7) == {}
    assert book.releasing() == set()


def test_a_reload_costs_nothing() -> None:
    book = DemandBook(hold_s=2)
    book.want("r", {"/odom": 10}, now_s=0)
    book.due("r", now_s=0)
    book.want("r", {}, now_s=5)
    assert book.due("r", now_s=5) is None
    book.want("r", {"/odom": 10}, now_s=6)
    assert book.due("r", now_s=60) is None


def test_less_rate_is_held_and_more_is_not() -> None:
    book = DemandBook(hold_s=2)
    book.want("r", {"/odom": 0}, now_s=0)
    book.due("r", now_s=0)
    book.want("r", {"/odom": 5}, now_s=1)
    assert book.due("r", now_s=2) is None
    assert book.due("r", now_s=3) == {"/odom": 5}
    book.want("r", {"/odom": 20}, now_s=3)
    assert book.due("r", now_s=3) == {"/odom": 20}


def test_a_new_link_was_told_nothing() -> None:
    book = DemandBook()
    book.want("r", {"/odom": 10}, now_s=0)
    book.due("r", now_s=0)
    book.forget("r")
    assert book.told("r") == {}
    assert book.due("r", now_s=0) == {"/odom": 10}
