"""Serial adapters as LD06 and LD19 come with. To listen would take the port from somebody, so we only look."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from metaros.drivers.probing import Found, serial_ports

__all__ = ["find"]

BRIDGES: Final = {(0x10C4, 0xEA60): "CP210x", (0x1A86, 0x7523): "CH340"}


def find() -> Sequence[Found]:
    """Ports that could have one."""
    return [
        Found(
            kind="ld19", summary=f"could be an LD06 or LD19: {text or device} ({bridge})", parameters={"port": device}
        )
        for device, text, vendor, product in serial_ports()
        if (bridge := BRIDGES.get((vendor, product)))
    ]
