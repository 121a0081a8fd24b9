"""Serial adapters as RPLIDARs come with; a question to a device that is none could move it, so we only look."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from metaros.drivers.probing import Found, serial_ports

__all__ = ["find"]

BRIDGES: Final = {(0x10C4, 0xEA60): "CP210x"}


def find() -> Sequence[Found]:
    """Ports that could have one."""
    return [
        Found(kind="rplidar", summary=f"could be an RPLIDAR: {text} ({bridge})", parameters={"port": device})
        for device, text, vendor, product in serial_ports()
        if (bridge := BRIDGES.get((vendor, product)))
    ]
