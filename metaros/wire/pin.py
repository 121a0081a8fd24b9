"""Keep one Python thread state per Zenoh thread instead of making and freeing one for every sample.

A Zenoh thread that calls Python gets a fresh thread state per call, which costs more than handing the sample over.
Taking the GIL's count once more than it is given back keeps the state for the thread's life. It is done where a
thread first brings a liveliness token, so that no sample pays for it.
"""

from __future__ import annotations

import ctypes
import sys
import threading

__all__ = ["pin_thread_state"]

_here = threading.local()


def pin_thread_state() -> None:
    """Pin the calling thread's state, once; does nothing where the interpreter is not CPython."""
    if getattr(_here, "pinned", False):
        return
    _here.pinned = True
    if sys.implementation.name == "cpython":
        ctypes.pythonapi.PyGILState_Ensure()
