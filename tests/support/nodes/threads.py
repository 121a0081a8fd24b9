"""A call on a thread of its own, and what it raises."""

from __future__ import annotations

import threading
from collections.abc import Callable

__all__ = ["on_thread"]


def on_thread(run: Callable[[], object]) -> tuple[threading.Thread, list[BaseException]]:
    """Start it; the thread, and where what it raises will be."""
    raised: list[BaseException] = []

    def runs() -> None:
        try:
            run()
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=runs, daemon=True)
    thread.start()
    return thread, raised
