"""Faults that one can simulate on a running driver by `~/fault`, where its parameter `allow_faults` says so."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from random import Random  # noqa: TID251 - the type alone

__all__ = ["CLEAR", "FAULTS", "FaultBox"]

CLEAR: Final = "clear"
FAULTS: Final[Mapping[str, str]] = {
    "unplug": "the device is gone until `clear`",
    "silent": "the device is there, and nothing that it reads is published",
    "garble": "bytes of what is read are changed, a handful in a thousand",
}


class FaultBox:
    """Which of the FAULTS are on."""

    def __init__(self, rng: Random) -> None:
        self._rng = rng
        self.on: frozenset[str] = frozenset()

    def inject(self, name: str) -> bool:
        """Begin a fault, or end all by `clear`; whether there is such a fault."""
        if name == CLEAR:
            self.on = frozenset()
        elif name in FAULTS:
            self.on |= {name}
        else:
            return False
        return True

    def garbled(self, data: bytes) -> bytes:
        """The bytes as a bad cable would bring them."""
        if "garble" not in self.on or not data:
            return data
        wrong = bytearray(data)
        for _ in range(1 + len(data) // 200):
            wrong[self._rng.randrange(len(wrong))] ^= 1 << self._rng.randrange(8)
        return bytes(wrong)
