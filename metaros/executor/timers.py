"""Timers as a heap: pure, driven by whatever `now` it is given."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from typing import Any

from metaros.errors import UsageError

__all__ = ["Timer", "TimerHeap"]


class Timer:
    """A callback every `period_s`. Late calls are not made up for: a slow callback skips, it never piles up."""

    __slots__ = ("_cancelled", "_heap", "busy", "callback", "due_s", "period_s")

    def __init__(self, heap: TimerHeap, period_s: float, callback: Callable[[], Any], due_s: float) -> None:
        self._heap = heap
        self._cancelled = False
        self.period_s = period_s
        self.callback = callback
        self.due_s = due_s
        self.busy = False

    @property
    def cancelled(self) -> bool:
        """Whether it will not be called again."""
        return self._cancelled

    def cancel(self) -> None:
        """Never call it again; safe to call twice."""
        self._cancelled = True

    def reset(self) -> None:
        """Start the period anew from now; revives a cancelled timer."""
        self._heap.restart(self)


class TimerHeap:
    """The timers of one clock, ordered by when they are due. `changed()` is called when one was added."""

    def __init__(self, now: Callable[[], float], changed: Callable[[], None]) -> None:
        self._now = now
        self._changed = changed
        self._heap: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()

    def add(self, period_s: float, callback: Callable[[], Any]) -> Timer:
        """A timer first due one period from now; UsageError unless the period is positive and finite."""
        if not 0 < period_s < float("inf"):
            raise UsageError(f"a timer's period must be a positive number of seconds, not {period_s}")
        timer = Timer(self, period_s, callback, self._now() + period_s)
        self._push(timer)
        return timer

    def restart(self, timer: Timer) -> None:
        """Give the timer a full period from now."""
        timer._cancelled = False
        timer.due_s = self._now() + timer.period_s
        self._push(timer)

    def next_due_s(self) -> float | None:
        """When the next timer is due; None without timers."""
        while self._heap:
            due_s, _, timer = self._heap[0]
            if not timer.cancelled and due_s == timer.due_s:
                return due_s
            heapq.heappop(self._heap)
        return None

    def pop_due(self) -> Timer | None:
        """The earliest timer that is due now, already put back for its next turn; None when none is."""
        due_s, now_s = self.next_due_s(), self._now()
        if due_s is None or due_s > now_s:
            return None
        timer = heapq.heappop(self._heap)[2]
        missed = int((now_s - due_s) / timer.period_s)  # whole periods that went by unserved
        timer.due_s = due_s + (missed + 1) * timer.period_s
        if timer.due_s <= now_s:  # the sum was rounded down onto now
            timer.due_s = now_s + timer.period_s
        self._push(timer, changed=False)
        return timer

    def _push(self, timer: Timer, *, changed: bool = True) -> None:
        heapq.heappush(self._heap, (timer.due_s, next(self._order), timer))
        if changed:
            self._changed()
