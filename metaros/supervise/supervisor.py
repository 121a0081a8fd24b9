"""Keeps a table of processes running, and stops them in order.

Single-threaded, on one event loop. Each process has one task that waits for those it comes after, starts it, waits for
its death, asks the policy and waits again. Nothing here blocks: on Linux output is read without blocking and deaths
arrive through a pidfd, elsewhere a thread waits for either. No queue: events go straight to `on_event`.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from metaros.clock import Clock
from metaros.errors import ConfigError, UnavailableError
from metaros.supervise.child import Child, ProcessStatus
from metaros.supervise.clean_up import clean_up
from metaros.supervise.events import Event, EventKind
from metaros.supervise.heartbeats import ENVIRONMENT, HeartbeatMonitor, HeartbeatPort
from metaros.supervise.orphan_reaper import OrphanReaper
from metaros.supervise.process import Launch, Process
from metaros.supervise.restart_policy import Exit, History, Quarantine, RestartAt, Stop, decide
from metaros.supervise.spare import Spare

if TYPE_CHECKING:
    from random import Random  # noqa: TID251  (the type of an argument)

__all__ = ["Supervisor"]

_LEAST_GRACE_S = 0.4
_CANNOT_START = 71  # EX_OSERR
_READY_STEP_S = 0.02
_READY_WITHIN_S = 10.0  # then those that come after it start anyway


class Supervisor:
    """Start processes with `start`, end with `stop`; `on_event` is called for every change.

    `is_ready(name)` says whether those that come after a running process may start; without it they may at once.
    `on_line(name, text)` gets every line that a process writes. `spare` serves the first restart after a healthy time.
    `may_run(name)` has the last word before each start.
    """

    def __init__(
        self,
        *,
        clock: Clock,
        rng: Random,
        on_event: Callable[[Event], None] = lambda event: None,
        on_line: Callable[[str, str], object] | None = None,
        is_ready: Callable[[str], bool] | None = None,
        spare: Spare | None = None,
        may_run: Callable[[str], bool] = lambda name: True,
    ) -> None:
        self._may_run = may_run
        self._clock = clock
        self._rng = rng
        self._on_event = on_event
        self._on_line = on_line
        self._is_ready = is_ready
        self._spare = spare
        self._children: dict[str, Child] = {}
        self._port = HeartbeatPort(clock.monotonic_s)
        self._reaper = OrphanReaper()

    def start(self, launches: Iterable[Launch]) -> None:
        """Start these processes and keep them running; call it on the event loop's thread."""
        for launch in launches:
            if launch.name in self._children:
                raise ConfigError(f"two processes are called {launch.name!r}")
            self._children[launch.name] = Child(launch)
        for child in self._children.values():
            if child.task is None:
                self._keep_task(child)

    def status(self) -> list[ProcessStatus]:
        """All processes, in the order of their start."""
        return [child.status() for child in self._children.values()]

    def knows(self, name: str) -> bool:
        """Whether there is a process of this name, running or not."""
        return name in self._children

    def status_of(self, name: str) -> ProcessStatus:
        """One of them. Raises UnavailableError."""
        return self._find(name).status()

    def tail(self, name: str) -> list[str]:
        """The last lines a process wrote."""
        process = self._children[name].process
        return process.log.tail() if process else []

    def restart(self, name: str, reason: str = "asked for") -> None:
        """Start it again: end it where it runs, or end its pause, its quarantine or its rest; its past is forgotten."""
        child = self._find(name)
        child.history = History()
        if child.task is None or child.task.done():
            self._keep_task(child)
        elif child.running:
            self._end_for(child, reason)
        else:
            child.wakeup.set()

    def add(self, launch: Launch) -> None:
        """Know it, and leave it stopped until `restart`."""
        if launch.name in self._children:
            raise ConfigError(f"two processes are called {launch.name!r}")
        self._children[launch.name] = child = Child(launch)
        child.state = "stopped"

    def change(self, launch: Launch) -> None:
        """Another row for the process of this name: its nice value counts now, its policy from its next exit on, its
        program from its next start on.
        """
        child = self._find(launch.name)
        child.launch = launch
        if child.process is not None and child.running:
            child.process.set_nice(launch.nice)

    async def remove(self, name: str) -> None:
        """End it and forget it; nobody waits for it any more."""
        child = self._find(name)
        await self.stop_one(name)
        del self._children[name]
        child.ready.set()

    def send(self, name: str, number: int) -> bool:
        """A signal to the process and all that it started; False where it does not run."""
        child = self._find(name)
        if child.process is None or not child.running:
            return False
        child.process.send(number)
        return True

    def kill_one(self, name: str) -> None:
        """Kill it at once, if it runs; what comes then is the policy's."""
        child = self._find(name)
        if child.process is not None:
            child.process.kill_if_running()

    async def stop_one(self, name: str, *, grace_s: float | None = None) -> None:
        """End it, and leave it so until `restart`, which must not come before this is done."""
        child = self._find(name)
        await self._end_tasks([child])
        await self._stop_one(child, child.launch.stop_grace_s if grace_s is None else grace_s)

    async def stop(self, *, grace_s: float = 5.0) -> None:
        """Stop all, last stage first: ask each to end, and kill who still runs when the grace time is over."""
        await self._end_tasks(self._children.values())
        deadline = self._clock.monotonic_s() + grace_s
        stages = sorted({child.launch.stage for child in self._children.values()}, reverse=True)
        for left, stage in zip(range(len(stages), 0, -1), stages, strict=True):
            rest_s = deadline - self._clock.monotonic_s()
            share_s = max(_LEAST_GRACE_S, rest_s - _LEAST_GRACE_S * (left - 1))  # a hung stage leaves the others some
            children = [child for child in self._children.values() if child.launch.stage == stage]
            await asyncio.gather(*(self._stop_one(child, share_s) for child in children))
        self._port.close()
        self._reaper.close()
        if self._spare is not None:
            self._spare.close()

    def kill(self) -> None:
        """Kill all at once: for an owner whose user has no patience. `stop` then ends quickly."""
        for child in self._children.values():
            if child.running and child.process is not None:
                child.process.kill()

    def _find(self, name: str) -> Child:
        if name not in self._children:
            raise UnavailableError(f"no process {name!r} here; there are: {', '.join(self._children)}")
        return self._children[name]

    # -- ending ----------------------------------------------------------------------------------------------------

    async def _end_tasks(self, children: Iterable[Child]) -> None:
        tasks = [child.task for child in children if child.task]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _stop_one(self, child: Child, grace_s: float) -> None:
        process = child.process
        child.ready.clear()
        child.blocked_by = []
        if process is None or not process.running:
            if process is not None and child.state == "running":  # it died while its task was being ended
                child.last_exit = (await process.wait()).reason
            child.state = "stopped"
            return
        process.ask_to_end()
        kind = EventKind.STOPPED
        with contextlib.suppress(TimeoutError):
            child.last_exit = (await asyncio.wait_for(process.wait(), grace_s)).reason
        if process.running:
            process.kill()
            child.last_exit = (await process.wait()).reason
            kind = EventKind.KILLED
        child.state = "stopped"
        self._report(child, kind, child.last_exit)

    def _end_for(self, child: Child, reason: str) -> None:
        """Ask a running process to end because it is to start again; kill it after its grace time."""
        process = child.process
        if process is None or child.asked:
            return
        child.asked = reason
        child.ready.clear()  # those that are restarted with it wait for the next one
        process.ask_to_end()
        asyncio.get_running_loop().call_later(child.launch.stop_grace_s, process.kill_if_running)

    # -- keeping ---------------------------------------------------------------------------------------------------

    def _keep_task(self, child: Child) -> None:
        child.state = "waiting"
        child.task = asyncio.get_running_loop().create_task(self._keep(child), name=f"keep {child.launch.name}")

    async def _keep(self, child: Child) -> None:
        while True:
            await self._wait_for_others(child)
            if child.launch.clean_up and not child.cleaned:
                await clean_up(child.launch.clean_up)
                child.cleaned = True
            if not self._may_run(child.launch.name):
                child.state = "stopped"
                return
            exit_ = await self._run(child)
            if child.asked:  # our own doing: no fault of its own
                self._report(child, EventKind.RESTARTING, child.asked)
                child.asked = ""
                self._take_along(child)
            elif not await self._after_death(child, exit_):
                return
            child.restarts += 1

    async def _after_death(self, child: Child, exit_: Exit) -> bool:
        """Wait as long as the policy says; False where it is not to start again."""
        now = self._clock.monotonic_s()
        decision, child.history = decide(child.history, exit_, now, self._rng, child.launch.policy)
        self._report(child, EventKind.EXITED, self._why(child, exit_))
        child.wakeup.clear()
        match decision:
            case Stop(reason):
                child.state = "ended"
                if child.launch.policy.critical and not exit_.clean:
                    self._report(child, EventKind.SAFE_STOP, "a critical process is not started again")
                self._report(child, EventKind.ENDED, reason)
                return False
            case Quarantine(until, exits):
                child.state = "quarantined"
                detail = f"{exits} exits within {child.launch.policy.window_s:.0f} s"
                self._report(child, EventKind.QUARANTINED, detail, delay_s=until - now)
                self._take_along(child)
                await self._pause(child, until - now)
            case RestartAt(at, safe_stop):
                child.state = "waiting"
                if safe_stop:
                    self._report(child, EventKind.SAFE_STOP, "a critical process keeps dying")
                self._report(child, EventKind.RESTARTING, child.hung or exit_.reason, delay_s=at - now)
                self._take_along(child)
                await self._pause(child, at - now)
        return True

    async def _pause(self, child: Child, seconds: float) -> None:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(child.wakeup.wait(), seconds)

    def _take_along(self, dead: Child) -> None:
        """Those that come after it and asked for it start again, too, once it is back."""
        for child in self._children.values():
            if child.launch.rest_for_one and dead.launch.name in child.launch.after and child.running:
                self._end_for(child, f"{dead.launch.name} restarted")
                self._take_along(child)

    async def _wait_for_others(self, child: Child) -> None:
        others = [self._children[name] for name in child.launch.after if name in self._children]
        child.blocked_by = [other.launch.name for other in others if not other.ready.is_set()]
        if child.blocked_by:
            child.state = "blocked"
        for other in others:
            await other.ready.wait()
            child.blocked_by = [other.launch.name for other in others if not other.ready.is_set()]
        child.blocked_by = []

    # -- one life --------------------------------------------------------------------------------------------------

    async def _run(self, child: Child) -> Exit:
        child.process, child.hung = None, ""
        pulse = HeartbeatMonitor(child.launch.heartbeat_s)
        token, env = "", {}
        if pulse.period_s:
            await self._port.open()
            token, env[ENVIRONMENT] = self._port.register(pulse)
        try:
            spare = self._spare if child.history.restarts == 1 else None  # a crash loop has no use for it
            child.process = Process(
                child.launch,
                env=env,
                on_line=self._line_sink(child),
                spare=spare,
                stamp=self._clock.wall_ns,
                reaper=self._reaper,
            )
        except OSError as error:  # no memory, no descriptors, no place for the log: the policy tries again
            self._port.forget(token)
            child.last_exit = f"cannot be started: {error.strerror}"
            return Exit(code=_CANNOT_START)
        child.started_at = self._clock.monotonic_s()
        child.history = child.history.started(child.started_at)
        child.state = "running"
        self._report(child, EventKind.STARTED)
        try:
            exit_ = await self._watched(child, child.process, pulse)
        finally:
            self._port.forget(token)
            child.ready.clear()
        if exit_.clean and child.launch.policy.restart != "always":  # done, not dead: what comes after it may start
            child.ready.set()
        child.last_exit = child.hung or exit_.reason
        return exit_

    async def _watched(self, child: Child, process: Process, pulse: HeartbeatMonitor) -> Exit:
        watchers = [asyncio.create_task(self._announce_ready(child))]
        if pulse.period_s:
            watchers.append(asyncio.create_task(self._watch_pulse(child, process, pulse)))
        try:
            return await process.wait()
        finally:
            for watcher in watchers:
                watcher.cancel()
            await asyncio.gather(*watchers, return_exceptions=True)

    async def _announce_ready(self, child: Child) -> None:
        name, slow = child.launch.name, ""
        if self._is_ready is not None:
            deadline = self._clock.monotonic_s() + _READY_WITHIN_S
            while not self._is_ready(name):
                if self._clock.monotonic_s() > deadline:
                    slow = f"not in the graph after {_READY_WITHIN_S:.0f} s: going on without"
                    break
                await asyncio.sleep(_READY_STEP_S)
            self._report(child, EventKind.READY, slow)
        child.ready.set()
        if self._spare is not None:
            self._spare.refill_soon()

    async def _watch_pulse(self, child: Child, process: Process, pulse: HeartbeatMonitor) -> None:
        """Where its heartbeats stop: SIGTERM, and after its grace time SIGKILL."""
        step_s = pulse.period_s / 2
        while True:
            woken_at = self._clock.monotonic_s()
            await asyncio.sleep(step_s)
            if self._clock.monotonic_s() - woken_at > 2 * step_s:
                await asyncio.sleep(step_s)  # it was us who were late: what waits in the socket comes first
            if pulse.hung(self._clock.monotonic_s()):
                break
        child.state, child.hung = "hung", f"hung: no heartbeat for {pulse.silence_s(self._clock.monotonic_s()):.1f} s"
        self._report(child, EventKind.HUNG, child.hung)
        process.terminate()
        await asyncio.sleep(child.launch.hang_grace_s)
        process.kill_if_running()

    def _line_sink(self, child: Child) -> Callable[[str], object] | None:
        sink, name = self._on_line, child.launch.name
        return None if sink is None else lambda text: sink(name, text)

    def _why(self, child: Child, exit_: Exit) -> str:
        """The exit in words, with the last line written, which is where a program says what went wrong."""
        if child.process is None:
            return child.last_exit
        reason = child.hung or exit_.reason
        tail = child.process.log.tail() if exit_.code else []
        return f"{reason}: {tail[-1]}" if tail else reason

    def _report(self, child: Child, kind: EventKind, detail: str = "", *, delay_s: float = 0.0) -> None:
        pid = child.process.pid if child.process else None
        event = Event(
            name=child.launch.name, kind=kind, detail=detail, pid=pid, restarts=child.restarts, delay_s=delay_s
        )
        self._on_event(event)
