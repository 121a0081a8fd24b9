"""The fair executor: nodes share one thread by weight, as processes share a CPU under Linux.

It is cooperative: a callback runs to completion. The slice of `FairSchedule` says how many queued callbacks of a node
run before the next pick, and what each took is charged to its node. Critical nodes are not scheduled at all: each has
a thread of its own.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine, Generator
from dataclasses import dataclass
from typing import Any, Final

from metaros.executor.critical_thread import CriticalThread
from metaros.executor.fair_schedule import FairSchedule, weight_of
from metaros.executor.ingress import Ingress
from metaros.executor.mailbox import Mailbox
from metaros.executor.protocol import Spinnable
from metaros.executor.single import SingleThreadedExecutor
from metaros.executor.timers import Timer

__all__ = ["FairExecutor", "NodeShare"]

_log = logging.getLogger("metaros.executor")
_CONTROL_SWITCH_INTERVAL_S: Final = 0.0001  # what a critical thread waits at most for a computing one to yield
_BLOCKED: Final = 0.1  # of the time on the wall, charged at least: who blocks is not idle, who was preempted may be


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeShare:
    """What one node had of the executor.

    `share` is its part of the run time of all scheduled nodes. `realtime` is "yes", "no: why" or "not started" for
    critical nodes, which are not measured, and empty for the others.
    """

    name: str
    nice: int
    weight: int
    run_s: float = 0.0
    virtual_s: float = 0.0
    share: float = 0.0
    critical: bool = False
    realtime: str = ""


class _Work:
    """What one node has to do: its timers, and its mailboxes with items, one item of each in turn."""

    __slots__ = ("boxes", "node", "timers_first")

    def __init__(self, node: Spinnable) -> None:
        self.node = node
        self.boxes: deque[Mailbox] = deque()
        self.timers_first = True

    def waits(self) -> bool:
        """Whether there is something to run."""
        due_s = None if self.boxes else self.node.timers.next_due_s()
        return bool(self.boxes) or (due_s is not None and due_s <= self.node.clock.monotonic_s())


class FairExecutor(SingleThreadedExecutor):
    """Shares its thread among nodes by their nice levels.

    `period_s` is T_sched of equation (1). `cpu_s` and `wall_s` measure what callbacks take: the CPU time of the thread,
    but at least a tenth of the time on the wall, so that a callback which blocks is not taken for idle, nor one that
    other programs preempt for busy.
    """

    def __init__(
        self,
        *,
        period_s: float = 0.02,
        cpu_s: Callable[[], float] = time.thread_time,
        wall_s: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self._lock = threading.Lock()  # nodes come and go from any thread, in the middle of a turn too
        self._schedule: FairSchedule[Spinnable] = FairSchedule(period_s=period_s)
        self._work_of: dict[Spinnable, _Work] = {}
        self._critical: dict[Spinnable, CriticalThread] = {}
        self._cpu_s, self._wall_s = cpu_s, wall_s
        self._current: Spinnable | None = None

    # -- nodes -----------------------------------------------------------------------------------------------------

    def add_node(self, node: Spinnable, *, nice: int | None = None, critical: bool | None = None) -> None:
        """Run this node's callbacks, too, at this nice level, or beside the schedule on a thread of its own.

        Both default to what the node was made with. UsageError when it belongs to another context than the others.
        """
        if node in self._members():
            return
        if getattr(node, "critical", False) if critical is None else critical:
            self._check_context(node)
            self.switch_interval_s = _CONTROL_SWITCH_INTERVAL_S
            thread = CriticalThread(node, quiet=bool(self._critical))
            self._critical[node] = thread
            if self._serving is not None:
                self._shorten_switch_interval()
                thread.start()
            return
        level = getattr(node, "nice", 0) if nice is None else nice
        weight_of(level)
        super().add_node(node)
        with self._lock:
            self._schedule.add(node, nice=level)
            self._work_of[node] = _Work(node)

    def remove_node(self, node: Spinnable) -> None:
        """Run its callbacks no more; its samples wait within their bounds."""
        if (thread := self._critical.pop(node, None)) is not None:
            thread.stop()
            thread.join()
            return
        with self._lock:
            work = self._work_of.pop(node, None)
            if work is None:
                return
            self._schedule.remove(node)
            self._give_back(work)
        super().remove_node(node)

    def renice(self, node: Spinnable, nice: int) -> None:
        """Give a scheduled node another nice level."""
        with self._lock:
            self._schedule.renice(node, nice)

    def report(self) -> list[NodeShare]:
        """What each node had so far, in the order in which they were added, critical ones last."""
        with self._lock:
            total_s = sum(self._schedule.run_s(node) for node in self._work_of) or 1.0
            rows = [
                NodeShare(
                    name=_name(node),
                    nice=self._schedule.nice(node),
                    weight=weight_of(self._schedule.nice(node)),
                    run_s=self._schedule.run_s(node),
                    virtual_s=self._schedule.virtual_s(node),
                    share=self._schedule.run_s(node) / total_s,
                )
                for node in self._work_of
            ]
        for node, thread in list(self._critical.items()):
            realtime = f"no: {thread.realtime_error}" if thread.realtime_error else "yes"
            realtime = "not started" if thread.realtime_error is None else realtime
            rows.append(NodeShare(name=_name(node), nice=0, weight=0, critical=True, realtime=realtime))
        return rows

    # -- life ------------------------------------------------------------------------------------------------------

    def shutdown(self) -> None:
        """Make `spin` return after the callback that runs; ends the critical threads, too. Safe from any thread."""
        super().shutdown()
        for thread in list(self._critical.values()):
            thread.stop()

    def _members(self) -> list[Spinnable]:
        return [*self._nodes, *self._critical]

    def _begin(self) -> Ingress:
        ingress = super()._begin()
        for thread in list(self._critical.values()):
            thread.start()
        return ingress

    def _end(self, ingress: Ingress) -> None:
        with self._lock:
            for work in self._work_of.values():
                self._give_back(work)
        super()._end(ingress)
        if self._stopped.is_set():
            for thread in list(self._critical.values()):
                thread.join()

    @staticmethod
    def _give_back(work: _Work) -> None:
        while work.boxes:
            work.node.ingress.requeue(work.boxes.popleft())

    # -- work ------------------------------------------------------------------------------------------------------

    def _work(self, ingress: Ingress) -> bool:
        """One turn of the node that is next; False when nobody has work."""
        with self._lock:
            for box in ingress.take_ready(self._ready_queue):
                work = self._work_of.get(box.owner)  # type: ignore[call-overload]
                if work is None:  # removed meanwhile
                    ingress.requeue(box)
                else:
                    work.boxes.append(box)
            for node, work in self._work_of.items():
                if not self._schedule.is_runnable(node) and work.waits():
                    self._schedule.wake(node)
            turn = self._schedule.pick()
            if turn is None:
                return False
            work = self._work_of[turn.key]
        self._take_turn(work, turn.slice_s)
        return True

    def _take_turn(self, work: _Work, slice_s: float) -> None:
        node, schedule = work.node, self._schedule
        self._current = node
        before = self._cpu_s(), self._wall_s()
        while not self._stopped.is_set():
            ran = self._run_next(work)
            after = self._cpu_s(), self._wall_s()
            spent_s = max(after[0] - before[0], _BLOCKED * (after[1] - before[1]))
            before = after
            with self._lock:
                if self._work_of.get(node) is not work:  # removed, by itself or by somebody else
                    break
                if not ran:
                    schedule.sleep(node)
                    break
                schedule.charge(node, spent_s)
            slice_s -= spent_s
            if slice_s <= 0:
                break
        self._current = None

    def _run_next(self, work: _Work) -> bool:
        """One callback: a timer's and a mailbox's in turn, so that neither keeps the other out."""
        work.timers_first = not work.timers_first
        if work.timers_first:
            return self._run_box(work) or self._run_due(work)
        return self._run_due(work) or self._run_box(work)

    def _run_due(self, work: _Work) -> bool:
        timer = work.node.timers.pop_due()
        if timer is None:
            return False
        if not timer.busy:
            self._run_timer(timer)
        return True

    def _run_box(self, work: _Work) -> bool:
        while (box := self._next_box(work)) is not None:
            ran = self._run_mailbox(box, 1)
            with self._lock:
                if box.pending and not box.busy and self._work_of.get(work.node) is work:
                    work.boxes.append(box)
                else:
                    work.node.ingress.requeue(box)
            if ran:
                return True
        return False

    def _next_box(self, work: _Work) -> Mailbox | None:
        with self._lock:
            return work.boxes.popleft() if work.boxes else None

    def _start(self, coroutine: Coroutine[Any, Any, Any], owner: Mailbox | Timer, *, counted: bool = False) -> None:
        """As ever, with every step of the coroutine charged to its node."""
        node = self._current
        super()._start(coroutine if node is None else self._metered(coroutine, node), owner, counted=counted)

    async def _metered(self, coroutine: Coroutine[Any, Any, Any], node: Spinnable) -> Any:
        return await _Steps(coroutine, self._cpu_s, lambda spent_s: self._charge(node, spent_s))

    def _charge(self, node: Spinnable, spent_s: float) -> None:
        with self._lock:
            if node in self._work_of:
                self._schedule.charge(node, spent_s)


class _Steps:
    """A coroutine whose steps are measured."""

    def __init__(
        self, coroutine: Coroutine[Any, Any, Any], clock: Callable[[], float], charge: Callable[[float], None]
    ) -> None:
        self._coroutine, self._clock, self._charge = coroutine, clock, charge

    def __await__(self) -> Generator[Any, Any, Any]:
        value: Any = None
        error: BaseException | None = None
        while True:
            before_s = self._clock()
            try:
                waits = self._coroutine.send(value) if error is None else self._coroutine.throw(error)
            except StopIteration as done:
                return done.value
            finally:
                self._charge(self._clock() - before_s)
            try:
                value, error = (yield waits), None
            except BaseException as thrown:  # cancelled: the coroutine is told
                value, error = None, thrown


def _name(node: Spinnable) -> str:
    return str(getattr(node, "full_name", node))
