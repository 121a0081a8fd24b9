"""A hot spare: a Python interpreter with its imports done, which waits on its input for the node to become.

It makes the difference between a cold start and the opening of a session, for any one node of a launcher at a time.
The one that was taken is replaced when the node that took it is ready, so that the two do not compete. It dies with
the supervisor as the nodes do.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
from collections.abc import Mapping
from pathlib import Path

from metaros.supervise import groups, parent_death

__all__ = ["ORDER_BYTES", "Spare"]

ORDER_BYTES = 16 * 1024  # what a pipe takes without a reader, everywhere
_CALM_S = 0.2  # after the last start, before the next spare is made
_EARLY = ("PYTHON", "LD_", "DYLD_", "MALLOC_")  # variables that are read when an interpreter starts


class Spare:
    """At most one process at a time; call it on the event loop's thread."""

    def __init__(self, argv: tuple[str, ...], *, cwd: Path, env: Mapping[str, str]) -> None:
        self._argv, self._cwd = argv, cwd
        self._env = dict(env)
        self._popen: subprocess.Popen[bytes] | None = None
        self._timer: asyncio.TimerHandle | None = None

    @property
    def pid(self) -> int | None:
        """Of the process that stands by."""
        return self._popen.pid if self._popen is not None and self._popen.poll() is None else None

    def refill_soon(self) -> None:
        """Make one when there was quiet for a moment."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(_CALM_S, self.refill)

    def refill(self) -> None:
        """Make one now, unless one stands by; where the system cannot, nodes start cold."""
        if self.pid is not None:
            return
        self.close()
        try:
            self._popen = subprocess.Popen(
                self._argv,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env={**os.environ, **self._env, parent_death.PARENT: str(os.getpid())},
                cwd=self._cwd,
                bufsize=0,
                **groups.spawn_options(),
            )
        except OSError:
            self._popen = None

    def take(
        self, arguments: tuple[str, ...], *, env: Mapping[str, str], cwd: Path | None
    ) -> subprocess.Popen[bytes] | None:
        """The spare, turned into the node of these arguments; None where there is none that fits."""
        popen = self._popen
        order = json.dumps({"arguments": arguments, "env": dict(env)}).encode() + b"\n"
        if popen is None or popen.poll() is not None or cwd != self._cwd or len(order) > ORDER_BYTES:
            return None
        if _early(env) != _early({**os.environ, **self._env}):
            return None
        assert popen.stdin is not None
        try:
            popen.stdin.write(order)
            popen.stdin.close()
        except OSError:  # it has just died
            return None
        self._popen = None
        return popen

    def close(self) -> None:
        """End it."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        popen, self._popen = self._popen, None
        if popen is not None:
            groups.kill(popen)
            popen.wait()
            for pipe in (popen.stdin, popen.stdout):
                if pipe is not None:
                    pipe.close()


def _early(env: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in env.items() if name.startswith(_EARLY)}
