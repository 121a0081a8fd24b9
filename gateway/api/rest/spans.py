"""One byte range of a stored file, as a request asks for it."""

from __future__ import annotations

import re

from starlette.requests import Request

__all__ = ["asked_span"]

_RANGE = re.compile(r"bytes=(\d{0,19})-(\d{0,19})")


def asked_span(request: Request, size_bytes: int, etag: str) -> tuple[int, int] | None:
    """The asked byte range, its end exclusive; None: all of it. An empty one cannot be satisfied."""
    match = _RANGE.fullmatch(request.headers.get("range", "").replace(" ", ""))
    if match is None or request.headers.get("if-range", etag) != etag:
        return None
    first, last = match.groups()
    if not first:
        return (max(0, size_bytes - int(last)), size_bytes) if last else None
    end = min(int(last) + 1, size_bytes) if last else size_bytes
    return (int(first), end) if not last or int(last) >= int(first) else None
