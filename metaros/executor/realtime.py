"""The real-time scheduling class of the operating system, for the calling thread, where it may be had."""

from __future__ import annotations

import os
import sys
from typing import Final

__all__ = ["make_realtime"]

_FIFO_PRIORITY: Final = 10  # above every ordinary thread, below the kernel's own
_TIME_CRITICAL: Final = 15  # THREAD_PRIORITY_TIME_CRITICAL


def make_realtime() -> str:
    """Put the calling thread into the real-time class; returns why that could not be done, or an empty string.

    Linux: SCHED_FIFO, which needs CAP_SYS_NICE or an rtprio limit; children do not inherit it. Windows: the highest
    thread priority. macOS offers no such call to Python.
    """
    if sys.platform == "win32":
        import ctypes

        kernel = ctypes.windll.kernel32
        done = kernel.SetThreadPriority(kernel.GetCurrentThread(), _TIME_CRITICAL)
        return "" if done else "SetThreadPriority failed"
    elif sys.platform == "linux":
        try:
            policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(0, policy, os.sched_param(_FIFO_PRIORITY))
        except OSError as error:
            return f"SCHED_FIFO was refused: {error.strerror}; give the program CAP_SYS_NICE or an rtprio limit"
        return ""
    else:
        return f"{sys.platform} has no real-time class for threads of Python"
