"""Lengths of time as people write them: `"5s"`, `"1h30m"`, `"250ms"`, or a number of seconds."""

from __future__ import annotations

import re
from typing import Any

from metaros.automation.rules.errors import WhenError
from metaros.automation.rules.numeric import is_number

__all__ = ["NS_PER_S", "read_period"]

NS_PER_S = 1_000_000_000
_UNITS_NS = {"ms": 1_000_000, "s": NS_PER_S, "m": 60 * NS_PER_S, "h": 3600 * NS_PER_S, "d": 86_400 * NS_PER_S}
_PIECE = re.compile(r"(\d{1,9}(?:\.\d{1,6})?)(ms|s|m|h|d)")
_WHOLE = re.compile(rf"(?:{_PIECE.pattern}){{1,5}}")


def read_period(value: Any, path: str, *, most_s: float) -> int:
    """Nanoseconds, one or more; WhenError for what is no length of time, or longer than `most_s`."""
    if isinstance(value, str) and _WHOLE.fullmatch(value):
        length_ns = round(sum(float(number) * _UNITS_NS[unit] for number, unit in _PIECE.findall(value)))
    elif is_number(value) and abs(value) < 1e12:
        length_ns = round(value * NS_PER_S)
    else:
        raise WhenError(path, f"is a time like '5s', '2m', '1h30m', '250ms', or seconds; not {str(value)[:40]!r}")
    if not 0 < length_ns <= most_s * NS_PER_S:
        raise WhenError(path, f"is longer than 0 and at most {most_s:g} s (rule_period_s)")
    return length_ns
