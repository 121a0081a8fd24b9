"""Who is saved next: what was told at once, the others when it is their time."""

from __future__ import annotations

from gateway.alerting.watch.saves import Saves


def test_robots_that_came_at_once_are_saved_one_after_another() -> None:
    saves, robots = Saves(every_s=60.0), [f"r{number}" for number in range(100)]
    for robot in robots:
        saves.begin(robot, 0.0)
    assert saves.due(1000.0) == []  # nothing is new
    saves.changed(robots)
    counts = [len(saves.due(second)) for second in (0.0, 15.0, 30.0, 45.0, 60.0)]
    assert counts[0] < 10 < counts[1] < counts[2] < counts[3] < counts[4] == 100


def test_what_was_reported_is_saved_first_and_what_is_saved_waits_for_its_next_time() -> None:
    saves = Saves(every_s=60.0)
    for robot in ("r1", "r2", "r3"):
        saves.begin(robot, 0.0)
    saves.changed(["r1", "r2", "r3", "nobody"])
    saves.hurry(["r3", "nobody"])
    assert saves.due(0.0)[:1] == ["r3"]
    assert sorted(saves.due(60.0)) == ["r1", "r2", "r3"]
    saves.saved("r3", 60.0)
    saves.changed(["r3"])
    assert "r3" not in saves.due(119.0)
    assert "r3" in saves.due(120.0)
    saves.forget("r1")
    saves.saved("r1", 60.0)
    saves.changed(["r1"])
    assert "r1" not in saves.due(1000.0)
