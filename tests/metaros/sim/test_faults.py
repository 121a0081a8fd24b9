"""The schedule grammar and the fault table."""

from __future__ import annotations

import pytest

from metaros.errors import ConfigError
from metaros.sim.faults import FAULTS, ScheduledFault, parse_schedule


def test_the_table_names_what_the_issue_names() -> None:
    assert set(FAULTS) == {"stuck_wheel", "hot_motor", "camera_freeze", "lidar_dropout", "lidar_slow", "battery_drain"}


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("sim_2:stuck_wheel@30", ScheduledFault("sim_2", "stuck_wheel", 30.0)),
        ("sim_1:hot_motor", ScheduledFault("sim_1", "hot_motor", 0.0)),
        (" sim_1:clear@1.5 ", ScheduledFault("sim_1", "clear", 1.5)),
    ],
)
def test_schedules(text: str, fault: ScheduledFault) -> None:
    assert parse_schedule(text) == fault


@pytest.mark.parametrize("text", ["", "stuck_wheel", "sim_2:", "sim_2:stuck_wheel@", "sim_2:stuck_wheel@-3", "a b:c@1"])
def test_not_a_schedule(text: str) -> None:
    with pytest.raises(ConfigError, match="ROBOT:FAULT@SECONDS"):
        parse_schedule(text)


def test_an_unknown_fault_is_reported_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="stuck_wheel"):
        parse_schedule("sim_1:flat_tyre@3")
