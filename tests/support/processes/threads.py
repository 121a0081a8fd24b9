"""Threads that a test started and left: those of other tests in the same process are not its business."""

from __future__ import annotations

import threading

__all__ = ["left_behind", "threads_now"]


def threads_now() -> set[threading.Thread]:
    """To be asked at a test's beginning."""
    return set(threading.enumerate())


def left_behind(before: set[threading.Thread], prefix: str = "metaros") -> list[str]:
    """Names of threads with that prefix that run now and did not run `before`."""
    return [thread.name for thread in threads_now() - before if thread.name.startswith(prefix)]
