"""What questions about history have in common: a range of time, and topics by name or pattern."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Annotated

from fastapi import Query

from gateway.api.rest.times import parse_time
from gateway.errors import InvalidRequestError
from metaros.idl.globs import Glob

__all__ = ["End", "Start", "Topics", "chosen_topics", "full_pattern", "parse_age", "parse_range"]

MAX_TOPICS = 64
MAX_AGE_NS = 30 * 86400 * 10**9
_AGE = re.compile(r"(\d{1,9}(?:\.\d{1,6})?)(ms|s|m|h|d)")
_UNIT_NS = {"ms": 10**6, "s": 10**9, "m": 60 * 10**9, "h": 3600 * 10**9, "d": 86400 * 10**9}

Start = Annotated[str, Query(description="RFC 3339, or relative like -15m")]
End = Annotated[str, Query(description="RFC 3339, relative, or now")]
Topics = Annotated[
    list[str] | None, Query(max_length=MAX_TOPICS, description="name or pattern, once for each; default: every topic")
]


def parse_range(start: str, end: str, *, now_ns: int) -> tuple[int, int]:
    """Two stamps; InvalidRequestError unless the first is the earlier one."""
    start_ns, end_ns = parse_time(start, now_ns=now_ns), parse_time(end, now_ns=now_ns)
    if end_ns <= start_ns:
        raise InvalidRequestError("end must be later than start")
    return start_ns, end_ns


def parse_age(text: str) -> int:
    """ "10s" in nanoseconds, at most 30 days."""
    found = _AGE.fullmatch(text)
    age_ns = round(float(found[1]) * _UNIT_NS[found[2]]) if found is not None else MAX_AGE_NS + 1
    if age_ns > MAX_AGE_NS:
        raise InvalidRequestError(f"max_age {text[:40]!r} is not like 10s or 2h, and at most 30d")
    return age_ns


def full_pattern(pattern: str, namespace: str) -> str:
    """A topic's name or pattern with the robot's namespace before it, unless it begins at the root."""
    if len(pattern) > 256:
        raise InvalidRequestError(f"topic {pattern[:40]!r}… is longer than 256 characters")
    return pattern if pattern.startswith(("/", "**")) else f"{namespace.rstrip('/')}/{pattern}"


def chosen_topics(names: Iterable[str], patterns: Sequence[str] | None, *, namespace: str) -> tuple[str, ...]:
    """Those of the names that a pattern matches, in their order; without a pattern all, each once."""
    globs = [Glob(full_pattern(pattern, namespace)) for pattern in patterns or ()]
    return tuple(dict.fromkeys(name for name in names if not globs or any(glob.matches(name) for glob in globs)))
