"""Names that people use, of modes above all."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from metaros.drivers.mavlink.names import (
    autopilot_name,
    is_autopilot,
    mode_name,
    mode_numbers_of,
    state_name,
    type_name,
)


@pytest.mark.parametrize(
    ("kind", "custom", "name"),
    [
        (dialect.MAV_TYPE_QUADROTOR, 4, "GUIDED"),
        (dialect.MAV_TYPE_FIXED_WING, 15, "GUIDED"),
        (dialect.MAV_TYPE_VTOL_TILTROTOR, 18, "QHOVER"),
        (dialect.MAV_TYPE_GROUND_ROVER, 4, "HOLD"),
        (dialect.MAV_TYPE_SUBMARINE, 2, "ALT_HOLD"),
        (dialect.MAV_TYPE_QUADROTOR, 200, "200"),
    ],
)
def test_modes_of_ardupilot(kind: int, custom: int, name: str) -> None:
    vehicle = type_name(kind)
    assert mode_name("ardupilot", vehicle, custom) == name
    assert mode_numbers_of("ardupilot", vehicle, name) == (None if name.isdigit() else (custom, 0))


def test_modes_of_px4() -> None:
    assert mode_name("px4", "copter", 6 << 16) == "OFFBOARD"
    assert mode_name("px4", "copter", 4 << 16 | 5 << 24) == "RTL"
    assert mode_name("px4", "copter", 99 << 16) == "99.0"
    assert mode_numbers_of("px4", "copter", " rtl ") == (4, 5)
    assert mode_numbers_of("px4", "copter", "GUIDED") is None
    assert mode_numbers_of("paparazzi", "plane", "GUIDED") is None


def test_kinds_and_states() -> None:
    assert [type_name(n) for n in (2, 1, 10, 12, 20, 8, 250)] == [
        *("copter", "plane", "rover", "submarine", "vtol", "free_balloon", "mav_type_250"),
    ]
    assert (autopilot_name(3), autopilot_name(12)) == ("ardupilot", "px4")
    assert state_name(4) == "active"


@pytest.mark.parametrize(
    ("kind", "autopilot", "is_one"), [(2, 3, True), (6, 8, False), (6, 3, False), (26, 3, False), (12, 12, True)]
)
def test_who_is_an_autopilot(kind: int, autopilot: int, is_one: bool) -> None:
    assert is_autopilot(dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 0, 3)) is is_one
