"""Kills orphans when the supervisor itself is killed: a small process beside it that holds the other end of a pipe.

The death signal of `parent_death` reaches a node, and not what the node has started: the driver behind a shell script,
the node behind `ros2 run`, a container. So the reaper knows every group that runs. At the end of its input, which comes
however the supervisor dies, it kills those that are left, and runs the clean-up command of each. It does nothing else.
What has made a session of its own escapes it, as it escapes a stop.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterable

from metaros.supervise import orphan_reaper_main

__all__ = ["OrphanReaper"]


class OrphanReaper:
    """The supervisor's side. It starts with the first group, and again when it died; nothing on Windows."""

    def __init__(self) -> None:
        self._groups: dict[int, tuple[str, ...]] = {}
        self._popen: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int | None:
        """Its process."""
        return self._popen.pid if self._popen is not None else None

    def group_started(self, group: int, last: Iterable[str] = ()) -> None:
        """This group runs now; `last` is a command that takes away what it leaves."""
        self._groups[group] = tuple(last)
        self._say([_began(group, self._groups[group])])

    def group_ended(self, group: int) -> None:
        """It was seen dead, all of it: its number may be another's from now on. Call it before that can be."""
        if self._groups.pop(group, None) is not None:
            self._say([{"ended": group}])

    def close(self) -> None:
        """Nothing runs any more, or is its business."""
        popen, self._popen = self._popen, None
        self._groups.clear()
        if popen is not None:
            _reap(popen)

    def _say(self, words: list[dict[str, object]]) -> None:
        if self._popen is None:
            self._start()
            return
        try:
            assert self._popen.stdin is not None
            os.write(self._popen.stdin.fileno(), _lines(words))
        except OSError:  # it is gone, or takes nothing any more
            self._start()

    def _start(self) -> None:
        """Start another one, and send it all groups."""
        if self._popen is not None:
            _reap(self._popen)
        if sys.platform != "win32":
            with contextlib.suppress(OSError):  # no memory: the kernel's request to each node is left
                popen = subprocess.Popen(
                    [sys.executable, "-I", "-S", orphan_reaper_main.__file__],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    bufsize=0,
                    start_new_session=True,
                )
                assert popen.stdin is not None
                assert popen.stdout is not None
                self._popen = popen
                asyncio.get_running_loop().add_reader(popen.stdout.fileno(), self._died, popen)
                os.write(popen.stdin.fileno(), _lines(_began(*row) for row in self._groups.items()))
                os.set_blocking(popen.stdin.fileno(), False)  # from now on nobody waits for it

    def _died(self, popen: subprocess.Popen[bytes]) -> None:
        """Its output, which it never uses, is at its end."""
        _reap(popen)
        if popen is self._popen:
            self._popen = None
            if self._groups:
                self._start()


def _reap(popen: subprocess.Popen[bytes]) -> None:
    popen.kill()  # before its input ends: it must not act
    popen.wait()
    assert popen.stdin is not None
    assert popen.stdout is not None
    with contextlib.suppress(RuntimeError):  # the loop is closed, and its readers with it
        asyncio.get_running_loop().remove_reader(popen.stdout.fileno())
    popen.stdin.close()
    popen.stdout.close()


def _began(group: int, last: tuple[str, ...]) -> dict[str, object]:
    return {"began": group, "last": list(last)}


def _lines(words: Iterable[dict[str, object]]) -> bytes:
    return b"".join(json.dumps(word).encode() + b"\n" for word in words)
