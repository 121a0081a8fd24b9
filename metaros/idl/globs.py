"""Patterns over topic names: `*` is any part of one segment, `**` any number of whole segments."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from metaros.errors import NameError_
from metaros.limits import LIMITS

__all__ = ["Glob"]

_ALLOWED = re.compile(r"[A-Za-z0-9_/*~.\[\]\-]+\Z")


class Glob:
    """A pattern, like "/sim_1/**", "**/odom" or "/sim_*/camera/*". `**` also stands for no segment at all."""

    __slots__ = ("_segments", "pattern", "separator")

    def __init__(self, pattern: str, *, separator: str = "/") -> None:
        """Compile `pattern`; `separator` is "/" for topics, "." for names of metric series."""
        if not isinstance(pattern, str) or not _ALLOWED.match(pattern):
            raise NameError_(f"{pattern!r} is no pattern: letters, digits, _ - . / and the wildcards * and **")
        if len(pattern) > LIMITS.ros_name_chars:
            raise NameError_(f"the pattern {pattern[:40]}… is longer than {LIMITS.ros_name_chars} characters")
        self.pattern = pattern
        self.separator = separator
        self._segments = pattern.split(separator)

    def matches(self, topic: str) -> bool:
        """Whether the whole of `topic` fits the pattern; time grows with the product of the lengths, never worse."""
        if "*" not in self.pattern:
            return topic == self.pattern
        return _fits(self._segments, topic.split(self.separator), "**", _segment_fits)

    def __repr__(self) -> str:
        return f"Glob({self.pattern!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Glob) and (other.pattern, other.separator) == (self.pattern, self.separator)

    def __hash__(self) -> int:
        return hash((self.pattern, self.separator))


def _segment_fits(pattern: str, segment: str) -> bool:
    return pattern == segment or ("*" in pattern and _fits(pattern, segment, "*", str.__eq__))


def _fits(pattern: Sequence[str], items: Sequence[str], star: str, fits: Callable[[str, str], bool]) -> bool:
    """Wildcard match that on a mismatch lets only the last star take one item more."""
    at = position = retry = 0
    last_star = -1
    while position < len(items):
        if at < len(pattern) and pattern[at] == star:
            last_star, retry = at, position
            at += 1
        elif at < len(pattern) and fits(pattern[at], items[position]):
            at += 1
            position += 1
        elif last_star >= 0:
            retry += 1
            at, position = last_star + 1, retry
        else:
            return False
    return all(rest == star for rest in pattern[at:])
