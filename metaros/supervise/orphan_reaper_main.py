"""Run by `orphan_reaper` as `python -I -S`: the process that cleans up after a supervisor that was killed.

Its input are lines of JSON, {"began": group, "last": [argv]} and {"ended": group}. At its end it kills the groups that
are left, and runs the clean-up command of each.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys

__all__ = ["LAST_S", "main"]

LAST_S = 30.0  # for a clean-up command


def main() -> None:
    """Listen to the end of the input, then kill what is left."""
    if sys.platform != "win32":  # there are no groups
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)  # it ends with its supervisor, not before
        groups = _listen()
        for group in groups:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(group, signal.SIGKILL)
        for popen in [_clean_up(argv) for argv in groups.values() if argv]:
            with contextlib.suppress(subprocess.TimeoutExpired):
                if popen is not None:
                    popen.wait(LAST_S)


def _listen() -> dict[int, list[str]]:
    """The groups that are left at the end of the input, with their clean-up commands."""
    groups: dict[int, list[str]] = {}
    for line in sys.stdin.buffer:
        word = json.loads(line)
        if "began" in word:
            groups[word["began"]] = word["last"]
        else:
            groups.pop(word["ended"], None)
    return groups


def _clean_up(argv: list[str]) -> subprocess.Popen[bytes] | None:
    nothing = subprocess.DEVNULL
    try:
        return subprocess.Popen(argv, stdin=nothing, stdout=nothing, stderr=nothing)
    except OSError:
        return None


if __name__ == "__main__":
    main()
