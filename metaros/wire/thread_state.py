"""Keep one Python thread state per Zenoh thread instead of making and freeing one for every sample.

A Zenoh thread that calls Python gets a fresh thread state per call, which costs more than handing the sample over.
Taking the GIL's count once more than it is given back keeps the state for the thread's life. It is done with every
liveliness token that a thread brings, so that no sample pays for it; a count grown by a few more tokens is the same.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from typing import Any

from metaros.concurrency.native_callbacks import chain

__all__ = ["pin_thread_state"]


def pin_thread_state(put: Callable[[Any], None]) -> Callable[[Any], Any]:
    """`put`, which afterwards pins the calling thread's state; a C function where `put` is.

    It is `put` itself where the interpreter is not CPython.
    """
    if sys.implementation.name != "cpython":
        return put
    # The C function takes no argument; one that it does not look at does no harm.
    ensure = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.py_object)(("PyGILState_Ensure", ctypes.pythonapi))
    return chain(put, ensure)
