"""Autopilots on this machine's USB ports, by the ids that QGroundControl knows them by; nothing is sent to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from metaros.drivers.probing import Found, serial_ports

__all__ = ["find"]

_VENDORS: Final = {
    0x26AC: "PX4 autopilot",
    0x2DAE: "CubePilot",
    0x3162: "Holybro autopilot",
    0x3163: "CUAV autopilot",
    0x3185: "PX4 autopilot",
    0x3643: "PX4 autopilot",
}
_ARDUPILOT: Final = {(0x1209, 0x5740), (0x1209, 0x5741)}
_STM32: Final = (0x0483, 0x5740)  # the chip maker's own, which ArduPilot had too, as many other boards


def find() -> Sequence[Found]:
    """Autopilots for certain; boards with the id of their chip as what could be one."""
    found = []
    for port, text, vendor, product in serial_ports():
        name = "ArduPilot autopilot" if (vendor, product) in _ARDUPILOT else _VENDORS.get(vendor, "")
        certain = bool(name)
        if (vendor, product) == _STM32:
            name = "could be an autopilot"
        if name:
            summary = f"{name} ({text})" if text else name
            found.append(Found(kind="mavlink", summary=summary, parameters={"link": port}, certain=certain))
    return found
