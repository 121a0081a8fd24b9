"""A child and its children as one group, which can be asked to end and killed; the platforms differ.

On POSIX it is a process group. Windows has none that a signal reaches: a child gets a console group of its own, is
asked with Ctrl-Break, and killing it kills it alone.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from typing import Any

__all__ = ["ask_to_end", "kill", "send", "set_nice", "spawn_options", "terminate"]


def spawn_options() -> dict[str, Any]:
    """What Popen needs to start a child in a group of its own: Ctrl-C is the supervisor's to pass on."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    else:
        return {"process_group": 0}


def ask_to_end(popen: subprocess.Popen[bytes]) -> None:
    """SIGINT to the group, or Ctrl-Break; nothing where it is gone."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        if sys.platform == "win32":
            popen.send_signal(signal.CTRL_BREAK_EVENT)
        else:
            os.killpg(popen.pid, signal.SIGINT)


def terminate(popen: subprocess.Popen[bytes]) -> None:
    """SIGTERM to the group, or Ctrl-Break; nothing where it is gone."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        if sys.platform == "win32":
            popen.send_signal(signal.CTRL_BREAK_EVENT)
        else:
            os.killpg(popen.pid, signal.SIGTERM)


def send(popen: subprocess.Popen[bytes], number: int) -> None:
    """Any signal to the group; nothing where it is gone, or where the platform has no such signal."""
    with contextlib.suppress(ProcessLookupError, PermissionError, ValueError):
        if sys.platform == "win32":
            popen.send_signal(number)
        else:
            os.killpg(popen.pid, number)


def set_nice(popen: subprocess.Popen[bytes], nice: int) -> None:
    """Its share of the processor; a raise that the system refuses, and Windows, leave it as it is."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PGRP, popen.pid, nice)


def kill(popen: subprocess.Popen[bytes]) -> None:
    """End what is left of the group at once."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        if sys.platform == "win32":
            popen.kill()
        else:
            os.killpg(popen.pid, signal.SIGKILL)
