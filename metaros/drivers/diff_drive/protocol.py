"""The serial protocol of ros_arduino_bridge. Pure. Source: its firmware ROSArduinoBridge (commands.h, the .ino file).

A command is one letter, its numbers separated by blanks, CR. Answers are lines that end in CR LF.
`e`: the two encoders, `left right`, as signed 32-bit counts. `r`: both to zero, `OK`. `m left right`: speeds in ticks
in one period of the board's controller, `OK`; the board stops by itself after 2 s without one. `o left right`: raw
PWM, `OK` (never used here: it goes round the controller). `b`: its baud rate. Others: `Invalid Command`.
"""

from __future__ import annotations

from typing import Final

__all__ = ["READ_ENCODERS", "STOP", "is_ok", "parse_encoders", "speeds"]

READ_ENCODERS: Final = b"e\r"
STOP: Final = b"m 0 0\r"
MAX_TICKS: Final = 32767  # boards keep a speed as `int`, which has 16 bits on an AVR
_LOW, _HIGH = -(2**31), 2**31 - 1


def speeds(left: int, right: int) -> bytes:
    """Turn the wheels; beyond MAX_TICKS both are limited by the same factor, so that the course stays."""
    scale = min(1.0, MAX_TICKS / max(abs(left), abs(right), 1))
    return b"m %d %d\r" % (int(left * scale), int(right * scale))


def is_ok(line: str) -> bool:
    """Whether a command was taken."""
    return line.strip() == "OK"


def parse_encoders(line: str) -> tuple[int, int] | None:
    """Left and right, or None where the line is none such."""
    words = line.split()
    if len(words) != 2 or not all(word.removeprefix("-").isdecimal() and len(word) <= 11 for word in words):
        return None
    left, right = int(words[0]), int(words[1])
    return (left, right) if _LOW <= left <= _HIGH and _LOW <= right <= _HIGH else None
