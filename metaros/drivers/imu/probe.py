"""Serial cables that WITMotion and others put on their sensors; which device hangs there, none of them tells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from metaros.drivers.probing import Found, serial_ports

__all__ = ["find"]

_CABLES: Final = {(0x1A86, 0x7523): "CH340", (0x10C4, 0xEA60): "CP2102"}


def find() -> Sequence[Found]:
    """Ports that could be an IMU; never certain, and nothing is sent to them."""
    return [
        Found(kind="imu", summary=f"{_CABLES[vendor, product]} serial cable, perhaps an IMU", parameters={"port": port})
        for port, _, vendor, product in serial_ports()
        if (vendor, product) in _CABLES
    ]
