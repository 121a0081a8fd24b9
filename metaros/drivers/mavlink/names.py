"""Names of vehicles, autopilots, states and modes: from MAVLink's numbers, and modes back to numbers. Pure.

ArduPilot's modes are the dialect's own tables; PX4's are those of its `px4_custom_mode.h`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

__all__ = ["autopilot_name", "is_autopilot", "mode_name", "mode_numbers", "mode_numbers_of", "state_name", "type_name"]

_TYPES: Final[Mapping[str, str]] = {
    "QUADROTOR": "copter",
    "COAXIAL": "copter",
    "HELICOPTER": "copter",
    "HEXAROTOR": "copter",
    "OCTOROTOR": "copter",
    "TRICOPTER": "copter",
    "DODECAROTOR": "copter",
    "DECAROTOR": "copter",
    "GENERIC_MULTIROTOR": "copter",
    "FIXED_WING": "plane",
    "GROUND_ROVER": "rover",
    "SURFACE_BOAT": "boat",
    "SUBMARINE": "submarine",
    "ANTENNA_TRACKER": "tracker",
}
_ARDUPILOT_MODES: Final[Mapping[str, str]] = {
    "copter": "COPTER_MODE",
    "plane": "PLANE_MODE",
    "vtol": "PLANE_MODE",
    "rover": "ROVER_MODE",
    "boat": "ROVER_MODE",
    "submarine": "SUB_MODE",
    "tracker": "TRACKER_MODE",
}
_PX4_MODES: Final[Mapping[tuple[int, int], str]] = {
    (1, 0): "MANUAL",
    (2, 0): "ALTCTL",
    (3, 0): "POSCTL",
    (4, 1): "READY",
    (4, 2): "TAKEOFF",
    (4, 3): "LOITER",
    (4, 4): "MISSION",
    (4, 5): "RTL",
    (4, 6): "LAND",
    (4, 8): "FOLLOW_TARGET",
    (4, 9): "PRECLAND",
    (5, 0): "ACRO",
    (6, 0): "OFFBOARD",
    (7, 0): "STABILIZED",
    (8, 0): "RATTITUDE",
}
_NO_VEHICLES: Final = frozenset({"GCS", "ONBOARD_CONTROLLER", "GIMBAL", "ADSB", "CAMERA", "FLARM", "ODID", "SERVO"})


def is_autopilot(heartbeat: Any) -> bool:
    """Whether a heartbeat is that of a vehicle's autopilot: no ground station, gimbal, camera or the like."""
    if heartbeat.autopilot == dialect.MAV_AUTOPILOT_INVALID:
        return False
    return _enum_name("MAV_TYPE", heartbeat.type) not in _NO_VEHICLES


def type_name(number: int) -> str:
    """`copter`, `plane`, `vtol`, `rover`, `boat`, `submarine`, `tracker`, or the dialect's name in small letters."""
    name = _enum_name("MAV_TYPE", number)
    return "vtol" if name.startswith("VTOL") else _TYPES.get(name, name.lower())


def autopilot_name(number: int) -> str:
    """`ardupilot`, `px4`, or the dialect's own name in small letters."""
    name = _enum_name("MAV_AUTOPILOT", number).lower()
    return "ardupilot" if name == "ardupilotmega" else name


def state_name(number: int) -> str:
    """`standby`, `active`, `critical`, …"""
    return _enum_name("MAV_STATE", number).lower()


def mode_name(autopilot: str, vehicle: str, custom_mode: int) -> str:
    """The name of a heartbeat's mode; a mode that is not known is its number."""
    if autopilot == "px4":
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        return _PX4_MODES.get((main, sub)) or _PX4_MODES.get((main, 0)) or f"{main}.{sub}"
    numbers = _ardupilot_modes(vehicle) if autopilot == "ardupilot" else {}
    return numbers.get(custom_mode, str(custom_mode))


def mode_numbers(autopilot: str, vehicle: str) -> dict[str, tuple[int, int]]:
    """What MAV_CMD_DO_SET_MODE wants for each mode that such a vehicle has: custom mode and sub-mode."""
    if autopilot == "px4":
        return {name: numbers for numbers, name in _PX4_MODES.items()}
    return {name: (number, 0) for number, name in _ardupilot_modes(vehicle).items()} if autopilot == "ardupilot" else {}


def mode_numbers_of(autopilot: str, vehicle: str, mode: str) -> tuple[int, int] | None:
    """The same for one mode, in letters of either size; None where there is no such mode."""
    return mode_numbers(autopilot, vehicle).get(mode.strip().upper())


@cache
def _ardupilot_modes(vehicle: str) -> Mapping[int, str]:
    table = _ARDUPILOT_MODES.get(vehicle, "")
    entries = dialect.enums.get(table, {})
    return {
        number: entry.name.removeprefix(f"{table}_")
        for number, entry in entries.items()
        if not entry.name.endswith("ENUM_END")
    }


def _enum_name(table: str, number: int) -> str:
    entry = dialect.enums[table].get(number)
    return entry.name.removeprefix(f"{table}_") if entry is not None else f"{table.lower()}_{number}"
