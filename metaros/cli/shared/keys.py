"""Single keys from the terminal while a command runs; nothing where there is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["keyboard"]


@contextmanager
def keyboard() -> Iterator[Callable[[], str] | None]:
    """A function that gives the key pressed since it was last asked, or an empty text; None without a terminal."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        yield None
    elif sys.platform == "win32":
        import msvcrt

        yield lambda: msvcrt.getwch() if msvcrt.kbhit() else ""
    else:
        import select
        import termios
        import tty

        before = termios.tcgetattr(sys.stdin)
        tty.setcbreak(sys.stdin)
        try:
            yield lambda: sys.stdin.read(1) if select.select([sys.stdin], [], [], 0.0)[0] else ""
        finally:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
