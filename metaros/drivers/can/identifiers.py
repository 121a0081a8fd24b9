"""Which frames may be sent, by their identifiers. Pure."""

from __future__ import annotations

from typing import Final

from metaros.errors import ConfigError

__all__ = ["MOST_IDS", "read_ids"]

MOST_IDS: Final = 4096
_STANDARD: Final = 1 << 11
_EXTENDED: Final = 1 << 29
_LONG: Final = len("0x00000100")


def read_ids(text: str) -> frozenset[tuple[int, bool]]:
    """`0x100, 0x200-0x20F`: identifiers and ranges of them, each with whether it is an extended one of 29 bits.

    As in candump's files, eight digits make an extended one (`0x00000100`); what has more than 11 bits is one anyway.
    ConfigError where it is none.
    """
    found: set[tuple[int, bool]] = set()
    for part in filter(None, (one.strip() for one in text.split(","))):
        first, _, last = part.partition("-")
        try:
            low, high = int(first, 0), int(last or first, 0)
        except ValueError:
            raise ConfigError(f"can: tx_ids: {part!r} is no identifier such as 0x100 or 0x200-0x20F") from None
        extended = len(first.strip()) >= _LONG or low >= _STANDARD
        if not 0 <= low <= high < (_EXTENDED if extended else _STANDARD) or high - low + len(found) >= MOST_IDS:
            raise ConfigError(
                f"can: tx_ids: {part!r}: identifiers are 0 to 0x7FF, extended ones of eight digits 0x00000000 to "
                f"0x1FFFFFFF, and {MOST_IDS} at most"
            )
        found.update((identifier, extended) for identifier in range(low, high + 1))
    return frozenset(found)
