"""Garbage collector settings of a long-lived process: what exists once a gateway has started is frozen.

A full collection looks at every object that may be in a cycle, and nothing else happens meanwhile: 0.2 to 0.5 s with
the modules of a gateway and ten thousand robots, in the middle of somebody's drive. What exists at the start is
therefore set aside; later collections look at what came since.
"""

from __future__ import annotations

import gc

__all__ = ["tune_garbage_collector"]

YOUNG = 10_000  # objects made since the last small collection; Python's 700 is for small programs


def tune_garbage_collector() -> None:
    """Collect once, then set aside what lives. For a process that is one gateway: what is set aside is never freed."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(YOUNG, 20, 20)
