"""A span of numbers, as `numeric` in a pattern says it: `[">", 0, "<=", 5]`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from metaros.automation.rules.errors import PatternError

__all__ = ["Span", "is_number", "read_span"]

_FORM = 'is like ["=", 5], ["<", 10] or [">", 0, "<=", 5]'


def is_number(value: Any) -> bool:
    """Whether it is a number of JSON: true and false are none, nor are NaN and infinity."""
    kind = type(value)
    return kind is int or (kind is float and math.isfinite(value))


@dataclass(frozen=True, slots=True)
class Span:
    """From `low` to `high`; a closed end belongs to it."""

    low: float = -math.inf
    high: float = math.inf
    low_closed: bool = False
    high_closed: bool = False

    def matches(self, value: Any) -> bool:
        """Whether a value of an event is a number in here."""
        if not is_number(value):
            return False
        above = value > self.low or (self.low_closed and value == self.low)
        return above and (value < self.high or (self.high_closed and value == self.high))


def read_span(value: Any, path: str) -> Span:
    """The span that a pattern says; PatternError names what is wrong with it."""
    if not isinstance(value, list) or len(value) not in (2, 4):
        raise PatternError(path, _FORM)
    pairs = [(value[at], _bound(value[at + 1], path)) for at in range(0, len(value), 2)]
    if pairs[0][0] == "=" and len(pairs) == 1:
        return Span(pairs[0][1], pairs[0][1], low_closed=True, high_closed=True)
    span = _between(pairs, path)
    if span.low > span.high or (span.low == span.high and not (span.low_closed and span.high_closed)):
        raise PatternError(path, f"no number is in {value}")
    return span


def _between(pairs: Sequence[tuple[Any, float]], path: str) -> Span:
    low, high, low_closed, high_closed = -math.inf, math.inf, False, False
    for sign, bound in pairs:
        if sign in (">", ">=") and low == -math.inf:
            low, low_closed = bound, sign == ">="
        elif sign in ("<", "<=") and high == math.inf:
            high, high_closed = bound, sign == "<="
        else:
            raise PatternError(path, f"{_FORM}; at most one bound below and one above, not {str(sign)[:20]!r} here")
    return Span(low, high, low_closed, high_closed)


def _bound(value: Any, path: str) -> float:
    if not is_number(value):
        raise PatternError(path, f"{_FORM}; {str(value)[:40]!r} is no number")
    return value  # type: ignore[no-any-return]  # an int stays one: 2**53 + 1 is compared as itself
