"""Boards that such a firmware runs on, by their USB ids; which firmware it is, the ids do not tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from metaros.drivers.probing import Found, serial_ports

__all__ = ["find"]

_ARDUINO: Final = (0x2341, 0x2A03)


def find() -> Sequence[Found]:
    """Arduino boards, which could be a base; never certain, and nothing is sent to them."""
    return [
        Found(kind="diff_drive", summary=f"{summary or 'Arduino'}, perhaps a base", parameters={"port": port})
        for port, summary, vendor, _ in serial_ports()
        if vendor in _ARDUINO
    ]
