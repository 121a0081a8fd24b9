"""Ctrl-C at a chosen moment: while the main thread is inside of a C function, or at each step of Python code."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Any

__all__ = ["interrupt_at", "interrupt_inside"]

_NEVER_S = 1000.0


def interrupt_inside(call: Callable[[], object]) -> None:
    """`call()`, a C function, with a Ctrl-C that is there once the function lets go of the GIL.

    No thread is made to give the GIL away meanwhile, so that the one which waits for it gets it from that function,
    mostly: call it several times. Either way it raises the KeyboardInterrupt, unless somebody swallowed it.
    """
    assert threading.current_thread() is threading.main_thread()
    ready, begun, before_s = threading.Event(), threading.Lock(), sys.getswitchinterval()
    begun.acquire()

    def interrupt() -> None:
        ready.set()
        begun.acquire()
        _thread.interrupt_main()

    thread = threading.Thread(target=interrupt)
    sys.setswitchinterval(_NEVER_S)
    try:
        thread.start()
        ready.wait()  # it goes on once the thread waits for the lock
        begun.release()
        call()
    finally:
        sys.setswitchinterval(before_s)
        thread.join()


def interrupt_at(step: int, code: CodeType, call: Callable[[], object]) -> bool:
    """`call()` with a SIGINT before its `step`-th bytecode instruction within `code`; False when it has fewer."""
    count, sent = 0, False

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        nonlocal count, sent
        if frame.f_code is not code:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            count += 1
            if count == step + 1:
                sent = True
                signal.raise_signal(signal.SIGINT)
        return trace

    sys.settrace(trace)
    try:
        call()
    finally:
        sys.settrace(None)
    return sent
