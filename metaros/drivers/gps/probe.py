"""Receivers on this machine's serial ports, by their USB ids; nothing is sent to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from metaros.drivers.probing import Found, serial_ports

__all__ = ["find"]

_U_BLOX: Final = 0x1546
_PROLIFIC: Final = 0x067B  # a mere cable, which many receivers ("GPS mouse") hide behind


def find() -> Sequence[Found]:
    """u-blox receivers for certain; Prolific cables as something that could be one."""
    return [
        Found(kind="gps", summary=summary or "serial port", parameters={"port": port}, certain=vendor == _U_BLOX)
        for port, summary, vendor, _ in serial_ports()
        if vendor in (_U_BLOX, _PROLIFIC)
    ]
