"""CAN over a serial line in ASCII (LAWICEL's protocol, "slcan"): lines to frames and back. Pure.

python-can has an adapter too; a byte that is not ASCII stops that one for good, and a line without an end fills memory.
"""

from __future__ import annotations

from typing import Any, Final

__all__ = ["BITRATES", "CLOSE", "MAX_LINE", "OPEN", "format_frame", "parse_frame", "set_bitrate"]

BITRATES: Final = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
OPEN: Final = b"O\r"
CLOSE: Final = b"C\r"
MAX_LINE: Final = 1 + 8 + 1 + 16 + 4  # with a time stamp
_HEX: Final = frozenset("0123456789abcdefABCDEF")
_ID_DIGITS: Final = {"t": 3, "r": 3, "T": 8, "R": 8}


def set_bitrate(bitrate: int) -> bytes:
    """What sets one of BITRATES."""
    return b"S%d\r" % BITRATES.index(bitrate)


def parse_frame(line: str) -> dict[str, Any] | None:
    """python-can's Message as keywords; None where the line is no frame (an answer, or garbage)."""
    digits = _ID_DIGITS.get(line[:1])
    if digits is None or len(line) < digits + 2 or not _HEX.issuperset(line[1:]):
        return None
    identifier, length = int(line[1 : digits + 1], 16), int(line[digits + 1], 16)
    extended, remote = line[0] in "TR", line[0] in "rR"
    rest = line[digits + 2 :]
    if (
        length > 8
        or identifier >= 1 << (29 if extended else 11)
        or len(rest) - (0 if remote else 2 * length) not in (0, 4)
    ):
        return None
    data = b"" if remote else bytes.fromhex(rest[: 2 * length])
    return {
        "arbitration_id": identifier,
        "is_extended_id": extended,
        "is_remote_frame": remote,
        "dlc": length,
        "data": data,
    }


def format_frame(*, identifier: int, extended: bool, remote: bool, length: int, data: bytes) -> bytes:
    """The line that sends a frame."""
    letter = ("R" if extended else "r") if remote else ("T" if extended else "t")
    number = f"{identifier:08X}" if extended else f"{identifier:03X}"
    return f"{letter}{number}{length:X}{'' if remote else data.hex().upper()}\r".encode()
