"""What is no metric: offline, late rows, flapping links, lost samples, crashing nodes."""

from __future__ import annotations

import pytest

from gateway.alerting.anomaly.checks import CheckTable
from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.anomaly.facts import COUNTED, Facts


@pytest.fixture
def facts() -> Facts:
    return Facts(CheckTable(DEFAULT_CHECKS))


def reported(facts: Facts, now_s: float) -> list[tuple[str, str, bool]]:
    return [(change.check.id, change.where, change.opened) for change in facts.tick(now_s)]


def test_a_robot_is_offline_after_half_a_minute_and_back_after_some_seconds(facts: Facts) -> None:
    facts.heartbeat("r", 100.0)
    assert reported(facts, 129.0) == []
    assert reported(facts, 130.0) == [("offline", "", True)]
    assert reported(facts, 139.0) == []
    facts.heartbeat("r", 140.0)
    assert reported(facts, 140.0) == reported(facts, 143.0) == []
    facts.heartbeat("r", 146.0)
    assert reported(facts, 146.0) == [("offline", "", False)]


def test_a_robot_that_was_never_received_is_not_offline(facts: Facts) -> None:
    facts.count("r", "sequence", "odom", 1.0, 0.0)
    assert ("offline", "", True) not in reported(facts, 1e6)


def test_late_rows_and_a_clock_ahead_are_reported_after_a_while(facts: Facts) -> None:
    for now_s in range(100, 140):
        facts.heartbeat("late", now_s, newest_s=now_s - 90.0)
        facts.heartbeat("ahead", now_s, newest_s=now_s + 90.0)
        changes = reported(facts, float(now_s))
        assert changes == ([("behind", "", True), ("ahead", "", True)] if now_s == 130 else [])


def test_a_robot_that_comes_back_has_its_while_until_its_rows_are_there(facts: Facts) -> None:
    facts.heartbeat("r", 100.0, newest_s=10.0)  # as after a restart of the gateway: nothing is there yet
    found = [change for now_s in range(100, 500) for change in reported(facts, float(now_s))]
    for now_s in range(500, 540):
        facts.heartbeat("r", float(now_s), newest_s=10.0 if now_s < 510 else now_s - 1.0)
        found += reported(facts, float(now_s))
    assert [change[0] for change in found] == ["offline", "offline"]


def test_a_link_that_comes_and_goes_is_reported(facts: Facts) -> None:
    found = []
    for n in range(6):
        facts.link("r", up=True, now_s=10.0 * n)
        facts.link("r", up=False, now_s=10.0 * n + 5.0)
        facts.heartbeat("r", 10.0 * n + 5.0)
        found += reported(facts, 10.0 * n + 5.0)
    assert found == [("link_flaps", "", True)]


def test_lost_samples_are_reported_by_stream_and_forgotten_after_their_window(facts: Facts) -> None:
    facts.count("r", "sequence", "odom", 7.0, 50.0)
    (change,) = facts.tick(51.0)
    assert (change.where, change.value) == ("odom", 7.0)
    assert reported(facts, 349.0) == []
    assert reported(facts, 351.0) == [("sequence", "odom", False)]
    assert not facts.robots["r"].events


def test_a_node_that_is_started_again_and_again_is_in_a_crash_loop(facts: Facts) -> None:
    for n in range(3):
        facts.count("r", "crash_loop", "camera", 1.0, 10.0 * n)
    assert reported(facts, 21.0) == [("crash_loop", "camera", True)]


def test_things_are_bounded_and_everything_outlives_a_snapshot(facts: Facts) -> None:
    for n in range(2 * COUNTED):
        facts.count("r", "sequence", f"stream {n}", 1.0, 0.0)
    assert len(facts.robots["r"].events) == COUNTED
    facts.heartbeat("r", 0.0)
    list(facts.tick(40.0))
    again = Facts(CheckTable(DEFAULT_CHECKS))
    again.load(facts.dump())
    assert again.dump() == facts.dump()
    assert reported(again, 400.0) == reported(facts, 400.0) != []


def test_a_clock_set_back_and_ten_years_are_no_trouble(facts: Facts) -> None:
    facts.heartbeat("r", 1e9)
    facts.count("r", "sequence", "odom", 7.0, 1e9)
    reported(facts, 1e9)
    assert reported(facts, 5.0) == [("sequence", "odom", False)]
    assert reported(facts, 1e9 + 3e8) == [("offline", "", True)]
