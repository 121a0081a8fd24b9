"""Run as `python -I -S parent_death.py PARENT_PID PROGRAM ARGUMENT...`: become PROGRAM, and die when the parent dies.

On Linux the kernel is asked to send SIGKILL at the parent's death (PR_SET_PDEATHSIG), which no way of dying of the
parent can prevent; the request outlives the exec. Doing it in a fresh interpreter instead of between fork and exec
keeps it safe in a program with threads. It costs about 12 ms, which a program that calls `die_with_parent` by itself
as its first act need not pay. Elsewhere the program is only executed.
"""

from __future__ import annotations

import os
import sys

__all__ = ["PARENT", "die_with_parent", "main"]

PARENT = "METAROS_PARENT_PID"  # in the environment of a supervised process

_PR_SET_PDEATHSIG = 1
_SIGKILL = 9


def die_with_parent(parent: int) -> None:
    """Ask for the signal, and check that the parent still lives."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, _SIGKILL, 0, 0, 0)
        if os.getppid() != parent:  # it died before we asked
            os._exit(1)


def main(argv: list[str]) -> None:
    """Ask for the signal, and execute."""
    die_with_parent(int(argv[1]))
    try:
        os.execvp(argv[2], argv[2:])
    except OSError as error:
        sys.stderr.write(f"{argv[2]}: {error.strerror}\n")
        os._exit(127)


if __name__ == "__main__":
    main(sys.argv)
