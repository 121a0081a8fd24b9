"""Boards that could speak our frames, by their USB ids. A question to one that does not could move something, so we
only look.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from metaros.drivers.probing import Found, serial_ports

__all__ = ["find"]

_BOARDS: Final = {
    0x2341: "Arduino",
    0x2A03: "Arduino",
    0x16C0: "Teensy",
    0x239A: "Adafruit board",
    0x2E8A: "Raspberry Pi Pico",
    0x303A: "ESP32",
}


def find() -> Sequence[Found]:
    """Boards that people program; never certain."""
    return [
        Found(kind="serial", summary=f"{_BOARDS[vendor]}, perhaps with our frames", parameters={"port": port})
        for port, _, vendor, _ in serial_ports()
        if vendor in _BOARDS
    ]
