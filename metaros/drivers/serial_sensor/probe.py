"""Serial ports: each could have something that says lines."""

from __future__ import annotations

from collections.abc import Sequence

from metaros.drivers.probing import Found, serial_ports

__all__ = ["find"]


def find() -> Sequence[Found]:
    """Every port that has a device by what the system says; never certain, and nothing is read."""
    return [
        Found(kind="serial_sensor", summary=f"{text or port}, perhaps with lines of values", parameters={"port": port})
        for port, text, vendor, _ in serial_ports()
        if vendor
    ]
