"""The watchdog over what moves."""

from __future__ import annotations

import pytest

from edge_agent.commands.drive_watchdog import DriveGuard
from metaros.clock import ManualClock

TOPIC = "/sim_1/cmd_vel"


@pytest.fixture
def guard(clock: ManualClock) -> DriveGuard:
    guard = DriveGuard(clock)
    assert guard.grant("lease", 3.0) == []
    return guard


def test_actuators_by_their_last_segment(guard: DriveGuard) -> None:
    assert guard.is_actuator("/sim_1/cmd_vel")
    assert guard.is_actuator("/cmd_vel")
    assert not guard.is_actuator("/sim_1/cmd_vel/echo")
    assert DriveGuard(ManualClock(), ["/arm/**"]).is_actuator("/arm/joint/effort")


def test_a_fresh_command_under_the_lease_is_taken(guard: DriveGuard) -> None:
    assert guard.accept(TOPIC, "lease", 1, 0.01) == ""
    assert guard.due() == []


@pytest.mark.parametrize(
    ("lease", "seq", "age_s", "verdict"),
    [("other", 2, 0.0, "no_lease"), ("", 2, 0.0, "no_lease"), ("lease", 2, 0.31, "stale"), ("lease", 1, 0.0, "old")],
)
def test_the_rest_is_refused(guard: DriveGuard, lease: str, seq: int, age_s: float, verdict: str) -> None:
    guard.accept(TOPIC, "lease", 1, 0.0)
    assert guard.accept(TOPIC, lease, seq, age_s) == verdict


def test_stops_300_ms_after_the_last_fresh_command_once(guard: DriveGuard, clock: ManualClock) -> None:
    for seq in range(1, 6):
        guard.accept(TOPIC, "lease", seq, 0.0)
        clock.advance(0.1)
        assert guard.due() == []
    assert guard.wait_s() == pytest.approx(0.2)
    clock.advance(0.199)
    assert guard.due() == []
    clock.advance(0.002)
    assert guard.due() == [TOPIC]
    assert guard.due() == []
    assert guard.wait_s() is None


def test_stale_commands_do_not_feed_the_watchdog(guard: DriveGuard, clock: ManualClock) -> None:
    guard.accept(TOPIC, "lease", 1, 0.0)
    for seq in range(2, 5):
        clock.advance(0.11)
        guard.accept(TOPIC, "lease", seq, 0.5)
    assert guard.due() == [TOPIC]


def test_driving_renews_the_lease(guard: DriveGuard, clock: ManualClock) -> None:
    for seq in range(1, 60):
        assert guard.accept(TOPIC, "lease", seq, 0.0) == ""
        clock.advance(0.1)
    clock.advance(3.0)
    assert not guard.holds("lease")
    assert guard.accept(TOPIC, "lease", 100, 0.0) == "no_lease"


def test_release_and_loss_stop_at_once(guard: DriveGuard) -> None:
    guard.accept(TOPIC, "lease", 1, 0.0)
    assert guard.release("other") == []
    assert guard.release("lease") == [TOPIC]
    assert not guard.holds("lease")
    guard.grant("next", 3.0)
    guard.accept(TOPIC, "next", 1, 0.0)
    assert guard.lost() == [TOPIC]
    assert guard.accept(TOPIC, "next", 2, 0.0) == "no_lease"


def test_another_holder_stops_what_the_last_one_drove(guard: DriveGuard) -> None:
    guard.accept(TOPIC, "lease", 50, 0.0)
    assert guard.grant("lease", 3.0) == []
    assert guard.grant("other", 3.0) == [TOPIC]
    assert guard.accept(TOPIC, "other", 1, 0.0) == ""


def test_a_lease_that_runs_out_stops(clock: ManualClock) -> None:
    guard = DriveGuard(clock, fresh_s=10.0)
    guard.grant("lease", 1.0)
    guard.accept(TOPIC, "lease", 1, 0.0)
    clock.advance(1.0)
    assert guard.due() == [TOPIC]


def test_a_published_command_is_watched_too(guard: DriveGuard, clock: ManualClock) -> None:
    guard.drove(TOPIC)
    clock.advance(0.3)
    assert guard.due() == [TOPIC]
