"""Stands in for `os` below OsDisk: counts system calls, fails the one it is told to, or stops the machine there.

The faults: `EIO`, `ENOSPC`, a `short` write followed by ENOSPC, a `crash` in the middle of the call, and `unsynced`, a
crash in which what was written and not synced is gone.
"""

from __future__ import annotations

import errno
import os
from typing import Any

__all__ = ["FAULTS", "CountingCalls", "PowerCutError"]

WATCHED = ("open", "write", "fdatasync", "fsync", "ftruncate", "replace", "unlink", "lseek", "close", "stat", "statvfs")
FAULTS = ("EIO", "ENOSPC", "short", "crash", "unsynced")


class PowerCutError(BaseException):
    """The machine stops at this call."""


class CountingCalls:
    """`fail_at` is the number of the call that fails, from 1; `fault` how. `fired` once it did."""

    def __init__(self, *, fail_at: int = 0, fault: str = "EIO") -> None:
        self.count = 0
        self.fired = False
        self.name = ""
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
