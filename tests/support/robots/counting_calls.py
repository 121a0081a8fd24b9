"""Stands in for `os` below OsDisk: counts system calls, fails the one it is told to, or stops the machine there.

The faults: `EIO`, `ENOSPC`, a `short` write followed by ENOSPC, a `crash` in the middle of the call, and `unsynced`, a
crash in which what was written and not synced is gone.
"""

from __future__ import annotations

import errno
import os
import sys
from typing import Any

__all__ = ["FAULTS", "CountingCalls", "PowerCutError", "points"]

WATCHED = ("open", "write", "fdatasync", "fsync", "ftruncate", "replace", "unlink", "lseek", "close", "stat", "statvfs")
FAULTS = ("EIO", "ENOSPC", "short", "crash", "unsynced")
_WRITES = ("open", "write", "fdatasync", "fsync", "ftruncate", "replace")
_APART = {"ENOSPC": _WRITES, "short": ("write",), "unsynced": ("write", "fdatasync")}  # else as EIO, or as a crash


def points(whole: CountingCalls, fault: str) -> list[int]:
    """The calls of a life, from 1, at which to fail: the first and the last of each place, where the fault is apart."""
    first: dict[object, int] = {}
    last: dict[object, int] = {}
    for at, (name, place) in enumerate(zip(whole.names, whole.places, strict=True), 1):
        if name in _APART.get(fault, WATCHED) and name != "close":
            first.setdefault((name, place), at)
            last[name, place] = at
    return sorted({*first.values(), *last.values()})


def _place() -> tuple[tuple[str, int], ...]:
    frame, found = sys._getframe(2), []
    while frame is not None:
        found.append((frame.f_code.co_filename, frame.f_lineno))
        frame = frame.f_back
    return tuple(found)


class PowerCutError(BaseException):
    """The machine stops at this call."""


class CountingCalls:
    """`fail_at` is the number of the call that fails, from 1; `fault` how. `fired` once it did."""

    def __init__(self, *, fail_at: int = 0, fault: str = "EIO") -> None:
        self.count = 0
        self.fired = False
        self.name = ""
        self.names: list[str] = []  # of all calls, in their order
        self.places: list[object] = []  # where each was made, lines of its callers included; of a life that is whole
        self._fail_at = fail_at
        self._fault = fault
        self._full = False
        self._sizes: dict[int, int] = {}  # descriptor -> bytes that are synced

    def __getattr__(self, name: str) -> Any:
        real = getattr(os, name)
        return self._watched(name, real) if name in WATCHED else real

    def _watched(self, name: str, real: Any) -> Any:
        def call(*args: Any, **more: Any) -> Any:
            self.count += 1
            self.names.append(name)
            if not self._fail_at:
                self.places.append(_place())
            if name == "ftruncate":
                self._sizes[args[0]] = args[1]
            if name == "write" and self._full:
                self._full = False
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            if self.count == self._fail_at and name != "close":
                self.fired, self.name = True, name
                return self._fail(name, real, args)
            return real(*args, **more)

        return call

    def _fail(self, name: str, real: Any, args: tuple[Any, ...]) -> Any:
        if self._fault in ("crash", "unsynced"):
            if name == "write":
                real(args[0], args[1][: len(args[1]) // 2])
            if self._fault == "unsynced" and name in ("write", "fdatasync"):
                os.ftruncate(args[0], self._sizes[args[0]])
            raise PowerCutError(name)
        if self._fault == "short" and name == "write":
            self._full = True
            return real(args[0], args[1][: len(args[1]) // 2])
        code = errno.ENOSPC if self._fault in ("ENOSPC", "short") else errno.EIO
        raise OSError(code, os.strerror(code))
