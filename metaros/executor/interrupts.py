"""Ctrl-C while an executor spins: never lost, whatever it interrupts.

Python's own handler raises KeyboardInterrupt wherever the main thread is. Where that is a destructor, or a callback
that a library calls and whose errors it only prints, nothing comes of it, and the program runs on. While an executor
spins the handler also takes a note, and the executor raises what was swallowed.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["Interrupts", "interrupts"]


class Interrupts:
    """The note."""

    def __init__(self) -> None:
        self.seen = False

    def check(self) -> None:
        """KeyboardInterrupt where there was one, which then did not come through."""
        if self.seen:
            raise KeyboardInterrupt


@contextmanager
def interrupts(wake: Callable[[], object]) -> Iterator[Interrupts]:
    """Note Ctrl-C and `wake()` who waits, besides raising KeyboardInterrupt.

    Only on the main thread, and only where Python's own handler is set: a program's own handler stays alone.
    """
    note = Interrupts()
    if threading.current_thread() is not threading.main_thread():
        yield note
        return
    own = signal.default_int_handler

    def interrupt(number: int, frame: FrameType | None) -> None:
        note.seen = True
        wake()
        own(number, frame)

    if signal.getsignal(signal.SIGINT) is not own:
        yield note
        return
    try:
        signal.signal(signal.SIGINT, interrupt)
        yield note
    finally:
        if signal.getsignal(signal.SIGINT) is interrupt:  # or a callback has set one of its own
            signal.signal(signal.SIGINT, own)
