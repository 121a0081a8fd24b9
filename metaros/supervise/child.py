"""The supervisor's state of one process, and the status that it shows."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from metaros.supervise.process import Launch, Process
from metaros.supervise.restart_policy import History

__all__ = ["Child", "ProcessStatus"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessStatus:
    """A process as it is now."""

    name: str
    state: str  # blocked, running, hung, waiting, quarantined, ended, stopped
    pid: int | None
    restarts: int
    last_exit: str
    started_at: float | None = None  # on the supervisor's monotonic clock, while it runs
    waits_for: str = ""  # the names of those that must be there first
    critical: bool = False
    ready: bool = False  # those that come after it may start


class Child:
    """One process: its row of the table, its task, what happened to it so far."""

    def __init__(self, launch: Launch) -> None:
        self.launch = launch
        self.history = History()
        self.process: Process | None = None
        self.task: asyncio.Task[None] | None = None
        self.state = "waiting"
        self.restarts = 0
        self.last_exit = ""
        self.started_at: float | None = None
        self.ready = asyncio.Event()  # those that come after it may start
        self.wakeup = asyncio.Event()  # ends its pause before the next start
        self.asked = ""  # why we end it ourselves, to start it again
        self.hung = ""  # why we kill it
        self.blocked_by: list[str] = []
        self.cleaned = False  # what a supervisor before this one may have left of it is gone

    @property
    def running(self) -> bool:
        """Whether its process lives."""
        return self.process is not None and self.process.running

    def status(self) -> ProcessStatus:
        """As it is now."""
        running = self.running
        return ProcessStatus(
            name=self.launch.name,
            state=self.state,
            pid=self.process.pid if self.process and running else None,
            restarts=self.restarts,
            last_exit=self.last_exit,
            started_at=self.started_at if running else None,
            waits_for=", ".join(self.blocked_by),
            critical=self.launch.policy.critical,
            ready=running and self.ready.is_set(),
        )
