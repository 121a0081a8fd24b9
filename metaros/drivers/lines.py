"""Lines of text out of a stream of bytes, whatever comes. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator

__all__ = ["LineSplitter"]


class LineSplitter:
    """Cuts at CR and LF. Lines that are too long or not ASCII are counted (`long_lines`, `bad_lines`) and skipped."""

    def __init__(self, *, max_bytes: int, count: Callable[[str], object]) -> None:
        self._max_bytes = max_bytes
        self._count = count
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> Iterator[str]:
        """Whole lines without their ends; empty ones are left out."""
        *lines, rest = (self._rest + data.replace(b"\r", b"\n")).split(b"\n")
        self._rest = rest
        for line in lines:
            skipped, self._skipping = self._skipping, False
            if skipped or not line:
                continue
            if len(line) > self._max_bytes:
                self._count("long_lines")
            elif not line.isascii() or b"\0" in line:
                self._count("bad_lines")
            else:
                yield line.decode("ascii")
        if len(self._rest) > self._max_bytes:
            if not self._skipping:
                self._count("long_lines")
            self._skipping, self._rest = True, b""

    def clear(self) -> None:
        """Forget a begun line."""
        self._rest, self._skipping = b"", False
