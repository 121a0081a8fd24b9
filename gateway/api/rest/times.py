"""Times in query strings: RFC 3339, relative to now, or now."""

from __future__ import annotations

import re
from datetime import UTC, datetime

from gateway.errors import InvalidRequestError

__all__ = ["parse_time"]

_RELATIVE = re.compile(r"-(\d{1,9}(?:\.\d{1,6})?)(ms|s|m|h|d)")
EARLIEST_NS, LATEST_NS = -2_208_988_800 * 10**9, 7_289_654_400 * 10**9  # 1900 to 2200, as every column takes them
_UNIT_NS = {"ms": 10**6, "s": 10**9, "m": 60 * 10**9, "h": 3600 * 10**9, "d": 86400 * 10**9}


def parse_time(text: str, *, now_ns: int) -> int:
    """Nanoseconds since the epoch; InvalidRequestError says what is understood."""
    if text == "now":
        return now_ns
    relative = _RELATIVE.fullmatch(text)
    if relative is not None:
        return _bounded(now_ns - round(float(relative[1]) * _UNIT_NS[relative[2]]), text)
    try:
        # A plus sign that was not percent-encoded arrives as a blank.
        moment = datetime.fromisoformat(text.replace(" ", "+") if "T" in text else text)
    except ValueError:
        raise InvalidRequestError(f"time {text[:40]!r} is neither RFC 3339, nor like -15m, nor now") from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return _bounded(round(moment.timestamp() * 1_000_000) * 1000, text)


def _bounded(stamp_ns: int, text: str) -> int:
    if not EARLIEST_NS <= stamp_ns < LATEST_NS:
        raise InvalidRequestError(f"time {text[:40]!r} is out of range")
    return stamp_ns
