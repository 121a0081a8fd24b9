"""A log file of bounded size: when full it becomes `<name>.1`, and the one before that is gone.

A stamped log has a head line that says at which place of all that was ever written the file begins, and each line has
its time before it. So a place stays the same place when the file is turned over.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

__all__ = ["HEAD_BYTES", "RotatingLog", "base_of", "stamp_text"]

_TAIL_LINES = 20
_LINE_BYTES = 16 * 1024  # of a stamped log; longer ones are cut into several
_HEAD: Final = b"# metaros log from byte %020d\n"
HEAD_BYTES: Final = len(_HEAD % 0)


def stamp_text(at_ns: int) -> str:
    """A time as a stamped log has it: UTC, to the microsecond."""
    return datetime.fromtimestamp(at_ns // 1_000_000_000, UTC).strftime("%Y-%m-%dT%H:%M:%S.") + (
        f"{at_ns % 1_000_000_000 // 1000:06d}Z"
    )


def base_of(path: Path) -> int | None:
    """The place at which a stamped log's file begins; None where there is none, or it is not stamped."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError:
        return None
    number = head[-21:-1]
    return int(number) if number.isdigit() and head == _HEAD % int(number) else None


class RotatingLog:
    """Appends bytes to `path`, at most `size_bytes` in it and as much again in `<path>.1`; keeps the last lines.

    `stamp` gives the time in nanoseconds and makes it a stamped log.
    """

    __slots__ = ("_base", "_file", "_on_line", "_partial", "_size", "_stamp", "_tail", "path", "size_bytes")

    def __init__(
        self,
        path: Path,
        *,
        size_bytes: int = 4 * 1024 * 1024,
        on_line: Callable[[str], object] | None = None,
        stamp: Callable[[], int] | None = None,
    ) -> None:
        self._on_line = on_line
        self._stamp = stamp
        self.path = path
        self.size_bytes = size_bytes
        path.parent.mkdir(parents=True, exist_ok=True)
        self._base = 0
        self._file = path.open("ab", buffering=0)
        self._size = path.stat().st_size
        if stamp is not None:
            self._begin()
        self._tail: deque[str] = deque(maxlen=_TAIL_LINES)
        self._partial = b""

    def write(self, data: bytes) -> None:
        """Append; a full disk must not take the process down, so failed writes are lost."""
        whole = self._remember(data)
        try:
            self._append(data if self._stamp is None else whole)
        except (OSError, ValueError):
            return

    def tail(self) -> list[str]:
        """The last lines written in this life, oldest first."""
        rest = self._partial.decode(errors="replace").strip()
        return [*self._tail, rest] if rest else list(self._tail)

    def close(self) -> None:
        """Close the file; a last line without an end is a line, too."""
        if self._partial:
            if self._stamp is not None:
                self.write(b"\n")
            elif self._on_line is not None:
                self._on_line(self._partial.decode(errors="replace").rstrip())
        self._file.close()

    def _append(self, data: bytes) -> None:
        if self._size and self._size + len(data) > self.size_bytes:
            self._rotate()
        self._size += self._file.write(data[-self.size_bytes :]) or 0

    def _rotate(self) -> None:
        self._file.close()
        try:
            self.path.replace(self.path.with_name(self.path.name + ".1"))
        finally:
            self._file = self.path.open("ab", buffering=0)
        self._base += self._size
        self._size = 0
        if self._stamp is not None:
            self._size = self._file.write(_HEAD % self._base) or 0

    def _begin(self) -> None:
        """Go on where the file ends; one that is not stamped, or was torn in its head, is turned over."""
        old = self.path.with_name(self.path.name + ".1")
        if self._size and (base := base_of(self.path)) is not None:
            self._base = base
            with self.path.open("rb") as file:
                file.seek(self._size - 1)
                if file.read() != b"\n":  # cut off by a power cut
                    self._size += self._file.write(b"\n") or 0
            return
        before = base_of(old)
        if before is not None:
            self._base = before + old.stat().st_size
        if self._size:
            self._rotate()
        else:
            self._size = self._file.write(_HEAD % self._base) or 0

    def _remember(self, data: bytes) -> bytes:
        """Keep the tail; what a stamped log writes of it."""
        *lines, rest = (self._partial + data).split(b"\n")
        if self._stamp is not None:
            lines = [line[at : at + _LINE_BYTES] for line in lines for at in range(0, len(line) or 1, _LINE_BYTES)]
            while len(rest) > _LINE_BYTES:
                lines.append(rest[:_LINE_BYTES])
                rest = rest[_LINE_BYTES:]
            self._partial = rest
        else:
            self._partial = rest[-4096:]
        texts = [text for line in lines if (text := line.decode(errors="replace").rstrip())]
        self._tail.extend(text[:4096] for text in texts)
        if self._on_line is not None:
            for text in texts:
                self._on_line(text)
        if self._stamp is None:
            return b""
        now = stamp_text(self._stamp())
        return "".join(f"{now} {text}\n" for text in texts).encode()
