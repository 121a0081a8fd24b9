"""Ten thousand robots are a few numbers, and the ones that lag most."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.ops.fleet_view import FleetView
from gateway.ops.meters import Families


@dataclass
class Counts:
    samples: int = 2
    bytes: int = 30
    duplicates: int = 1
    gaps: int = 0
    lost: int = 0
    over_quota: int = 0
    put_off: int = 0


def values(view: FleetView) -> dict[tuple[str, ...], float]:
    """Every series by its name and labels."""
    families = Families()
    view.put(families)
    return {
        (sample.name, *sample.labels.values()): sample.value
        for family in families.collect()
        for sample in family.samples
    }


def test_series_of_single_robots_are_bounded_whatever_the_fleet() -> None:
    view = FleetView(most=20)
    for number in range(10_000):
        view.add(f"r{number}", number % 2 == 0, Counts(), number / 1000, 0.01, number)
        view.lost([("live", 2), ("made-up", 3)])
    found = values(view)
    robots = {labels[0] for name, *labels in found if name == "metaros_robot_lag_seconds"}
    assert robots == {f"r{number}" for number in range(9998, 9958, -2)}, "the twenty online ones that lag most"
    assert len([1 for name, *_ in found if name == "metaros_robot_backlog_bytes"]) == 20
    assert len(found) < 80
    assert found["metaros_agent_lost_samples", "live"] == 20_000
    assert ("metaros_agent_lost_samples", "made-up") not in found
    assert found["metaros_robots", "online"] == found["metaros_robots", "offline"] == 5000
    assert found["metaros_link_samples_total",] == 20_000
    assert found["metaros_backlog_bytes",] == sum(range(10_000))
    assert found["metaros_lag_seconds", "0.5"] == 5.0
    assert found["metaros_lag_seconds", "1"] == 9.998


def test_what_nobody_knows_is_left_out() -> None:
    view = FleetView(most=20)
    view.add("r1", True, Counts(), None, None, 0)
    view.add("r2", False, Counts(), 5.0, 5.0, 0)
    names = {name for name, *_ in values(view)}
    assert not names & {"metaros_robot_lag_seconds", "metaros_lag_seconds", "metaros_link_rtt_seconds"}


def test_robots_of_other_gateways_are_theirs_to_judge() -> None:
    view = FleetView(most=20)
    view.add("r1", True, Counts(), 1.0, 0.5, 10)
    view.add_remote(Counts(), online=True)
    view.add_remote(Counts(), online=False)  # it was there last
    found = values(view)
    assert [found["metaros_robots", state] for state in ("online", "elsewhere", "offline")] == [1, 1, 1]
    assert found["metaros_backlog_bytes",] == 10
    assert found["metaros_link_samples_total",] == 3 * Counts().samples
