"""Timers as a heap: pure, driven by whatever `now` it is given."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from metaros.errors import UsageError
from metaros.executor.groups import CallbackGroup

__all__ = ["Timer", "TimerHeap", "TimerStatistics"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TimerStatistics:
    """How well a timer was served. A call that comes a period or more late is an overrun; the periods are missed."""

    calls: int
    overruns: int
    missed: int
    max_lateness_s: float


class Timer:
    """A callback every `period_s`, without drift. Late calls are not made up for: a slow callback skips periods."""

    __slots__ = (
        "_calls",
        "_cancelled",
        "_heap",
        "_max_lateness_s",
        "_missed",
        "_overruns",
        "busy",
        "callback",
        "due_s",
        "group",
        "period_s",
        "running",
    )

    def __init__(
        self,
        heap: TimerHeap,
        period_s: float,
        callback: Callable[[], Any],
        due_s: float,
        group: CallbackGroup | None = None,
    ) -> None:
        self._heap = heap
        self._cancelled = False
        self.period_s = period_s
        self.callback = callback
        self.due_s = due_s
        self.group = group
        self.running = 0  # calls that are not done
        self.busy = False  # whether no other may start meanwhile
        self._calls = self._overruns = self._missed = 0
        self._max_lateness_s = 0.0

    @property
    def cancelled(self) -> bool:
        """Whether it will not be called again."""
        return self._cancelled

    @property
    def statistics(self) -> TimerStatistics:
        """How well it was served since it was made."""
        return TimerStatistics(
            calls=self._calls,
            overruns=self._overruns,
            missed=self._missed,
            max_lateness_s=self._max_lateness_s,
        )

    def cancel(self) -> None:
        """Never call it again; safe to call twice."""
        self._cancelled = True

    def reset(self) -> None:
        """Start the period anew from now; revives a cancelled timer."""
        self._heap.restart(self)

    def is_ready(self) -> bool:
        """Whether it is due now."""
        return not self._cancelled and self._heap.now_s() >= self.due_s

    def time_until_next_s(self) -> float | None:
        """Seconds until it is due, negative when it is late; None when it is cancelled."""
        return None if self._cancelled else self.due_s - self._heap.now_s()

    def _count(self, lateness_s: float, missed: int) -> None:
        if self.busy:  # the call before is not done: this one is left out, too
            missed += 1
        else:
            self._calls += 1
        self._missed += missed
        self._overruns += missed > 0
        self._max_lateness_s = max(self._max_lateness_s, lateness_s)


class TimerHeap:
    """The timers of one clock, ordered by when they are due. `changed()` is called when one was added.

    `paused` says that the clock does not run by itself: no use to wait for a timer, something will call `changed`.
    """

    def __init__(self, now: Callable[[], float], changed: Callable[[], None], *, paused: bool = False) -> None:
        self.now_s = now
        self.paused = paused
        self._changed = changed
        self._heap: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()
        self._jumped = False

    def add(self, period_s: float, callback: Callable[[], Any], group: CallbackGroup | None = None) -> Timer:
        """A timer first due one period from now; UsageError unless the period is positive and finite."""
        if not 0 < period_s < float("inf"):
            raise UsageError(f"a timer's period must be a positive number of seconds, not {period_s}")
        timer = Timer(self, period_s, callback, self.now_s() + period_s, group)
        self._push(timer)
        return timer

    def restart(self, timer: Timer) -> None:
        """Give the timer a full period from now."""
        timer._cancelled = False
        timer.due_s = self.now_s() + timer.period_s
        self._push(timer)

    def restart_all(self) -> None:
        """Give every timer a full period from now: the clock jumped, and the times they wait for mean nothing."""
        for timer in {entry[2] for entry in list(self._heap)}:
            if not timer.cancelled:
                self.restart(timer)

    def jump(self) -> None:
        """The clock jumped: `restart_all`, done by the executor, which alone may touch the heap. For any thread."""
        self._jumped = True
        self._changed()

    def next_due_s(self) -> float | None:
        """When the next timer is due; None without timers."""
        if self._jumped:
            self._jumped = False
            self.restart_all()
        while self._heap:
            due_s, _, timer = self._heap[0]
            if not timer.cancelled and due_s == timer.due_s:
                return due_s
            heapq.heappop(self._heap)
        return None

    def pop_due(self, before_s: float | None = None) -> Timer | None:
        """The earliest timer due now, already put back for its next turn; None when none is.

        With `before_s` only what was due then, so that a pass over the timers ends.
        """
        due_s = self.next_due_s()
        if due_s is None or (before_s is not None and due_s > before_s):
            return None
        now_s = self.now_s()
        if due_s > now_s:
            return None
        timer = heapq.heappop(self._heap)[2]
        missed = int((now_s - due_s) / timer.period_s)  # whole periods that went by unserved
        timer._count(now_s - due_s, missed)
        timer.due_s = due_s + (missed + 1) * timer.period_s
        if timer.due_s <= now_s:  # the sum was rounded down onto now
            timer.due_s = now_s + timer.period_s
        self._push(timer, changed=False)
        return timer

    def _push(self, timer: Timer, *, changed: bool = True) -> None:
        heapq.heappush(self._heap, (timer.due_s, next(self._order), timer))
        if changed:
            self._changed()
