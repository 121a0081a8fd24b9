"""Flushing the outbox: what to do in which order, and the task that has a thread do it.

`steps` is the procedure itself, without a thread or a loop: it yields jobs and is told how each went, so that a test
can run it in one thread and stop it anywhere.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

from edge_agent.errors import DiskError, DiskFullError
from edge_agent.outbox.classes import LOGS, LogName
from edge_agent.outbox.disk import Disk
from edge_agent.outbox.outbox import Outbox
from edge_agent.outbox.rewrite import RewriteJob

__all__ = ["Job", "OutboxWriter", "Steps", "run_steps", "steps"]

RESERVE_EVERY_S = 5.0


class Job(Protocol):
    """Something that blocks on the disk."""

    def run(self) -> None:
        """Raises DiskError when it did not work; nothing is then half done."""


Steps = Generator[Job, DiskError | None, None]


def steps(outbox: Outbox, disk: Disk, name: LogName) -> Steps:
    """Flush one log: room for its class, the write, and on a full disk relief and the write again."""
    while (room := outbox.room_job(name.partition("_")[0])) is not None:
        if not (yield from rewriting(outbox, room)):
            break
    if (job := outbox.flush_job(name)) is not None:
        error: DiskError | None = None
        if (ids := outbox.ids.job()) is not None:
            error = yield from trying(outbox, ids, name)
            if error is None:
                outbox.ids.written(ids)
        if error is None:
            error = yield from trying(outbox, job.append, name)
        if error is None:
            outbox.flushed(job)
        else:
            outbox.refused(job, error.code)
    for garbage in outbox.sweep():
        yield Removal(disk, garbage)


def trying(outbox: Outbox, job: Job, name: LogName) -> Generator[Job, DiskError | None, DiskError | None]:
    """Run a write, again whenever room could be made for it; the error that stayed."""
    while (error := (yield job)) is not None:
        relieved = isinstance(error, DiskFullError) and (yield from relieving(outbox, name))
        if not relieved:
            return error
    return None


def relieving(outbox: Outbox, name: LogName) -> Generator[Job, DiskError | None, bool]:
    """Free some of a full disk; False when nothing yields any more."""
    if (job := outbox.relief_job(name)) is not None:
        done = yield from rewriting(outbox, job)
        if done:
            return True
    released = Release(outbox)
    yield released
    return released.done


def rewriting(outbox: Outbox, job: RewriteJob) -> Generator[Job, DiskError | None, bool]:
    """Run a rewrite, with the reserve's help where even its small file finds no space; whether it was done."""
    error = yield job
    if isinstance(error, DiskFullError):
        released = Release(outbox)
        yield released
        if released.done:
            error = yield job
    outbox.rewritten(job, done=error is None)
    return error is None


class Removal:
    """Delete a file that nobody needs."""

    def __init__(self, disk: Disk, name: str) -> None:
        self._disk = disk
        self._name = name

    def run(self) -> None:
        """Raises DiskError; the file is then found, and passed over, at the next start."""
        self._disk.remove(self._name)


class Release:
    """Give up the reserve."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self.done = False

    def run(self) -> None:
        """Raises DiskError."""
        self.done = self._outbox.release_reserve()


def run_steps(procedure: Steps) -> None:
    """Run a procedure in this thread."""
    error: DiskError | None = None
    try:
        while True:
            job = procedure.send(error)
            try:
                job.run()
            except DiskError as failed:
                error = failed
            else:
                error = None
    except StopIteration:
        return


class OutboxWriter:
    """Flushes logs as they fall due; its one thread does all that blocks. `on_flushed` is called on the loop."""

    def __init__(self, outbox: Outbox, disk: Disk, *, on_flushed: Callable[[], None]) -> None:
        self._outbox = outbox
        self._disk = disk
        self._on_flushed = on_flushed
        self._wake = asyncio.Event()
        self._ending = False
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="outbox-writer")

    def wake(self) -> None:
        """Something was gathered."""
        self._wake.set()

    async def run(self) -> None:
        """Until cancelled; what was gathered by then is flushed.

        The flushing is a task of its own: a cancellation never comes between a job on the thread and its end here.
        """
        tasks = [asyncio.create_task(self._serve()), asyncio.create_task(self._keep_reserve())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)  # neither ends unless it fails
        finally:
            self._ending = True
            self._wake.set()
            tasks[1].cancel()
            await asyncio.wait(tasks)
            self._thread.shutdown()
        for task in tasks:
            if not task.cancelled():
                task.result()

    async def _serve(self) -> None:
        """Flush what falls due; at the end everything, once."""
        loop = asyncio.get_running_loop()
        while not self._ending:
            self._wake.clear()
            waits = [due for name in LOGS if (due := self._outbox.due_s(name)) is not None]
            timer = loop.call_later(min(waits), self._wake.set) if waits else None
            await self._wake.wait()
            if timer is not None:
                timer.cancel()
            await self._flush([name for name in LOGS if self._outbox.due_s(name) == 0.0])
        await self._flush(list(LOGS))

    async def _flush(self, names: list[LogName]) -> None:
        for name in names:
            await self._run(steps(self._outbox, self._disk, name))
        if names:
            self._on_flushed()

    async def _run(self, procedure: Steps) -> None:
        loop, error = asyncio.get_running_loop(), None
        try:
            while True:
                job = procedure.send(error)
                error = await loop.run_in_executor(self._thread, attempt, job)
        except StopIteration:
            return

    async def _keep_reserve(self) -> None:
        while True:
            await asyncio.get_running_loop().run_in_executor(self._thread, attempt, Restore(self._outbox))
            await asyncio.sleep(RESERVE_EVERY_S)


class Restore:
    """Take the reserve back where there is space for it."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox

    def run(self) -> None:
        """Raises DiskError."""
        self._outbox.restore_reserve()


def attempt(job: Job) -> DiskError | None:
    """Run a job; the error it ended with."""
    try:
        job.run()
    except DiskError as error:
        return error
    return None
