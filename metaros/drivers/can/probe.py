"""CAN buses of this machine: the system's own interfaces, and serial adapters by their USB ids. Nothing is sent."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from metaros.drivers.probing import Found, serial_ports

__all__ = ["INTERFACES", "find", "interfaces"]

INTERFACES: Final = Path("/sys/class/net")
_ARPHRD_CAN: Final = "280"  # linux/if_arp.h
_SLCAN: Final = {(0xAD50, 0x60C4): "CANtact or CANable", (0x16D0, 0x117E): "CANable 2"}


def find() -> Sequence[Found]:
    """Each bus."""
    known = [
        Found(kind="can", summary=f"CAN bus of the system, {state}", parameters={"channel": name}, certain=True)
        for name, state in interfaces()
    ]
    adapters = [
        Found(
            kind="can",
            summary=f"{_SLCAN[vendor, product]}, a serial adapter",
            parameters={"interface": "slcan", "channel": port},
            certain=True,
        )
        for port, _, vendor, product in serial_ports()
        if (vendor, product) in _SLCAN
    ]
    return known + adapters


def interfaces(folder: Path = INTERFACES) -> list[tuple[str, str]]:
    """Name and state, such as up or down, of each of SocketCAN's; none where the system has no such thing."""
    found = []
    for place in sorted(folder.glob("*")):
        try:
            if (place / "type").read_text().strip() == _ARPHRD_CAN:
                found.append((place.name, (place / "operstate").read_text().strip()))
        except OSError:
            continue
    return found
