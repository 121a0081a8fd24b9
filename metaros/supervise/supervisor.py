"""Keeps a table of processes running, and stops them in order.

Single-threaded, on one event loop. Each process has one task that starts it, waits for its death, asks the policy and
waits again. Nothing here blocks: on Linux output is read without blocking and deaths arrive through a pidfd, elsewhere
a thread waits for either. No queue: events go straight to `on_event`.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from metaros.clock import Clock
from metaros.errors import ConfigError
from metaros.supervise.events import Event, EventKind
from metaros.supervise.policy import Exit, History, Quarantine, RestartAt, Stop, decide
from metaros.supervise.process import Launch, Process

if TYPE_CHECKING:
    from random import Random  # noqa: TID251  (the type of an argument)

__all__ = ["ProcessStatus", "Supervisor"]

_LEAST_GRACE_S = 0.4
_CANNOT_START = 71  # EX_OSERR


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessStatus:
    """A process as it is now."""

    name: str
    state: str  # running, waiting, quarantined, ended, stopped
    pid: int | None
    restarts: int
    last_exit: str


class _Child:
    """The supervisor's memory of one process."""

    def __init__(self, launch: Launch) -> None:
        self.launch = launch
        self.history = History()
        self.process: Process | None = None
        self.task: asyncio.Task[None] | None = None
        self.state = "waiting"
        self.restarts = 0
        self.last_exit = ""

    def status(self) -> ProcessStatus:
        running = self.process is not None and self.process.running
        return ProcessStatus(
            name=self.launch.name,
            state=self.state,
            pid=self.process.pid if self.process and running else None,
            restarts=self.restarts,
            last_exit=self.last_exit,
        )


class Supervisor:
    """Start processes with `start`, end with `stop`; every change is told to `on_event`."""

    def __init__(self, *, clock: Clock, rng: Random, on_event: Callable[[Event], None] = lambda event: None) -> None:
        self._clock = clock
        self._rng = rng
        self._on_event = on_event
        self._children: dict[str, _Child] = {}

    def start(self, launches: Iterable[Launch]) -> None:
        """Start these processes and keep them running; call it on the event loop's thread."""
        for launch in launches:
            if launch.name in self._children:
                raise ConfigError(f"two processes are called {launch.name!r}")
            child = self._children[launch.name] = _Child(launch)
            child.task = asyncio.get_running_loop().create_task(self._keep(child), name=f"keep {launch.name}")

    def status(self) -> list[ProcessStatus]:
        """All processes, in the order of their start."""
        return [child.status() for child in self._children.values()]

    def tail(self, name: str) -> list[str]:
        """The last lines a process wrote."""
        process = self._children[name].process
        return process.log.tail() if process else []

    async def stop(self, *, grace_s: float = 5.0) -> None:
        """Stop all, last stage first: ask each to end, and kill who still runs when the grace time is over."""
        await self._end_tasks()
        deadline = self._clock.monotonic_s() + grace_s
        stages = sorted({child.launch.stage for child in self._children.values()}, reverse=True)
        for left, stage in zip(range(len(stages), 0, -1), stages, strict=True):
            rest_s = deadline - self._clock.monotonic_s()
            share_s = max(_LEAST_GRACE_S, rest_s - _LEAST_GRACE_S * (left - 1))  # a hung stage leaves the others some
            children = [child for child in self._children.values() if child.launch.stage == stage]
            await asyncio.gather(*(self._stop_one(child, share_s) for child in children))

    def kill(self) -> None:
        """Kill all at once: for an owner whose user has no patience. `stop` then ends quickly."""
        for child in self._children.values():
            if child.process is not None and child.process.running:
                child.process.kill()

    async def _end_tasks(self) -> None:
        tasks = [child.task for child in self._children.values() if child.task]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _stop_one(self, child: _Child, grace_s: float) -> None:
        process = child.process
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
        self._tell(child, kind, child.last_exit)

    async def _keep(self, child: _Child) -> None:
        while True:
            exit_ = await self._run(child)
            now = self._clock.monotonic_s()
            decision, child.history = decide(child.history, exit_, now, self._rng, child.launch.policy)
            self._tell(child, EventKind.EXITED, self._why(child, exit_))
            match decision:
                case Stop(reason):
                    child.state = "ended"
                    self._tell(child, EventKind.ENDED, reason)
                    return
                case Quarantine(until, exits):
                    child.state = "quarantined"
                    detail = f"{exits} exits within {child.launch.policy.window_s:.0f} s"
                    self._tell(child, EventKind.QUARANTINED, detail, delay_s=until - now)
                    await asyncio.sleep(until - now)
                case RestartAt(at, safe_stop):
                    child.state = "waiting"
                    if safe_stop:
                        self._tell(child, EventKind.SAFE_STOP, "a critical process keeps dying")
                    self._tell(child, EventKind.RESTARTING, exit_.reason, delay_s=at - now)
                    await asyncio.sleep(at - now)
            child.restarts += 1

    async def _run(self, child: _Child) -> Exit:
        child.process = None
        try:
            child.process = Process(child.launch)
        except OSError as error:  # no memory, no descriptors, no place for the log: the policy tries again
            child.last_exit = f"cannot be started: {error.strerror}"
            return Exit(code=_CANNOT_START)
        child.history = child.history.started(self._clock.monotonic_s())
        child.state = "running"
        self._tell(child, EventKind.STARTED)
        exit_ = await child.process.wait()
        child.last_exit = exit_.reason
        return exit_

    def _why(self, child: _Child, exit_: Exit) -> str:
        """The exit in words, with the last line written, which is where a program says what went wrong."""
        if child.process is None:
            return child.last_exit
        tail = child.process.log.tail() if exit_.code else []
        return f"{exit_.reason}: {tail[-1]}" if tail else exit_.reason

    def _tell(self, child: _Child, kind: EventKind, detail: str = "", *, delay_s: float = 0.0) -> None:
        pid = child.process.pid if child.process else None
        event = Event(
            name=child.launch.name, kind=kind, detail=detail, pid=pid, restarts=child.restarts, delay_s=delay_s
        )
        self._on_event(event)
