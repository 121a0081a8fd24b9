"""A log file of bounded size: when full it becomes `<name>.1`, and the one before that is gone."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path

__all__ = ["RotatingLog"]

_TAIL_LINES = 20


class RotatingLog:
    """Appends bytes to `path`, at most `size_bytes` in it and as much again in `<path>.1`; keeps the last lines."""

    __slots__ = ("_file", "_on_line", "_partial", "_size", "_tail", "path", "size_bytes")

    def __init__(
        self, path: Path, *, size_bytes: int = 4 * 1024 * 1024, on_line: Callable[[str], object] | None = None
    ) -> None:
        self._on_line = on_line
        self.path = path
        self.size_bytes = size_bytes
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("ab", buffering=0)
        self._size = path.stat().st_size
        self._tail: deque[str] = deque(maxlen=_TAIL_LINES)
        self._partial = b""

    def write(self, data: bytes) -> None:
        """Append; a full disk must not take the process down, so failed writes are lost."""
        self._remember(data)
        try:
            if self._size and self._size + len(data) > self.size_bytes:
                self._rotate()
            self._size += self._file.write(data[-self.size_bytes :]) or 0
        except OSError:
            return

    def tail(self) -> list[str]:
        """The last lines written in this life, oldest first."""
        rest = self._partial.decode(errors="replace").strip()
        return [*self._tail, rest] if rest else list(self._tail)

    def close(self) -> None:
        """Close the file; a last line without an end is a line, too."""
        if self._on_line is not None and self._partial:
            self._on_line(self._partial.decode(errors="replace").rstrip())
        self._file.close()

    def _rotate(self) -> None:
        self._file.close()
        self.path.replace(self.path.with_name(self.path.name + ".1"))
        self._file = self.path.open("ab", buffering=0)
        self._size = 0

    def _remember(self, data: bytes) -> None:
        *lines, rest = (self._partial + data).split(b"\n")
        texts = [text for line in lines if (text := line.decode(errors="replace").rstrip())]
        self._tail.extend(texts)
        self._partial = rest[-4096:]
        if self._on_line is not None:
            for text in texts:
                self._on_line(text)
