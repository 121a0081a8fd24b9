"""A time span as people write it on the command line: 90s, 30m, 12h, 2d."""

from __future__ import annotations

import re

from metaros.errors import UsageError

__all__ = ["span_s"]

_SPAN = re.compile(r"(\d{1,9}(?:\.\d{1,6})?)(ms|s|m|h|d)?")
_UNIT_S = {"ms": 0.001, "s": 1.0, "m": 60.0, "h": 3600.0, "d": 86_400.0, None: 1.0}


def span_s(text: str, flag: str) -> float:
    """Its seconds, without a unit seconds already. UsageError names the flag where it is none, or nothing."""
    match = _SPAN.fullmatch(text)
    if match is None or not float(match[1]):
        raise UsageError(f"{flag} {text}: not a span like 90s, 30m, 12h or 2d")
    return float(match[1]) * _UNIT_S[match[2]]
