"""One supervised process: started in its own group by `parent_death`, its output captured, its death awaited.

Spawn from the thread that lives as long as the supervisor (the event loop's): Linux ties the parent-death signal to
the thread that forked.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from metaros.supervise import groups, parent_death
from metaros.supervise.clean_up import clean_up
from metaros.supervise.heartbeats import ENVIRONMENT as HEARTBEAT
from metaros.supervise.logs.file import RotatingLog
from metaros.supervise.logs.output import follow
from metaros.supervise.orphan_reaper import OrphanReaper
from metaros.supervise.restart_policy import Exit, RestartPolicy
from metaros.supervise.spare import Spare

__all__ = ["Launch", "Process"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Launch:
    """One row of a launch table: what to run, and how to keep it."""

    name: str
    argv: tuple[str, ...]
    log_path: Path
    stage: int = 0  # stages start in rising order and stop in falling order
    env: Mapping[str, str] = field(default_factory=dict)  # added to the supervisor's own
    cwd: Path | None = None
    policy: RestartPolicy = field(default_factory=RestartPolicy)
    log_bytes: int = 4 * 1024 * 1024
    log_stamped: bool = False  # each line with its time and place: what `metaros.supervise.logs.reader` pages through
    clean_up: tuple[str, ...] = ()  # run before the first start and after each end
    after: tuple[str, ...] = ()  # it starts when these are ready
    rest_for_one: bool = False  # it is started again when one of these was
    heartbeat_s: float = 0.0  # how often its nodes say that they live; 0: they are not asked
    hang_grace_s: float = 3.0  # between SIGTERM and SIGKILL for one that hangs
    stop_grace_s: float = 5.0  # between SIGINT and SIGKILL for one that is to be started again or stopped alone
    nice: int = 0  # of the operating system: 19 yields to all others
    own_guard: bool = False  # its program asks by itself to die with its parent: `parent_death.die_with_parent`
    program_words: int = 1  # how many words of `argv` are the program; a spare gets the others


class Process:
    """A running child. `await wait()` gives how it ended; `ask_to_end` and `kill` reach its whole group."""

    def __init__(
        self,
        launch: Launch,
        *,
        env: Mapping[str, str] | None = None,
        on_line: Callable[[str], object] | None = None,
        spare: Spare | None = None,
        stamp: Callable[[], int] | None = None,
        reaper: OrphanReaper | None = None,
    ) -> None:
        self.launch = launch
        self._reaper = reaper
        self._reaped = False  # its number may be another's
        self._cleaning: asyncio.Task[None] | None = None
        self._env = {**_inherited(), **launch.env, **(env or {}), parent_death.PARENT: str(os.getpid())}
        self._spare = spare
        self.log = RotatingLog(
            launch.log_path,
            size_bytes=launch.log_bytes,
            on_line=on_line,
            stamp=stamp if launch.log_stamped else None,
        )
        self._loop = asyncio.get_running_loop()
        self._ended: asyncio.Future[Exit] = self._loop.create_future()
        self._popen = self._spawn()
        if reaper is not None:
            reaper.group_started(self.pid, launch.clean_up)
        assert self._popen.stdout is not None
        self._output = follow(self._loop, self._popen.stdout, self.log.write)
        self._watch_death()

    @property
    def pid(self) -> int:
        """The child's process id, which is also its group's."""
        return self._popen.pid

    @property
    def running(self) -> bool:
        """False once its death was seen, and what it left was taken away."""
        return not self._ended.done()

    async def wait(self) -> Exit:
        """Wait for the end; safe to cancel and to call again."""
        return await asyncio.shield(self._ended)

    def ask_to_end(self) -> None:
        """SIGINT (Windows: Ctrl-Break) to all of its group that is left."""
        if not self._reaped:
            groups.ask_to_end(self._popen)

    def terminate(self) -> None:
        """SIGTERM (Windows: Ctrl-Break) to all of its group that is left."""
        if not self._reaped:
            groups.terminate(self._popen)

    def send(self, number: int) -> None:
        """A signal to all of its group; on Windows those that it has, to the process."""
        if not self._reaped:
            groups.send(self._popen, number)

    def set_nice(self, nice: int) -> None:
        """Its share of the processor from now on."""
        if not self._reaped:
            groups.set_nice(self._popen, nice)

    def kill(self) -> None:
        """End its whole group at once."""
        if not self._reaped:
            groups.kill(self._popen)

    def kill_if_running(self) -> None:
        """The same, unless its death was seen: its number may be another's by then."""
        if not self._reaped:
            self.kill()

    def _spawn(self) -> subprocess.Popen[bytes]:
        launch, popen = self.launch, None
        if self._spare is not None and launch.own_guard:
            popen = self._spare.take(launch.argv[launch.program_words :], env=self._env, cwd=launch.cwd)
        popen = popen or self._start()
        if launch.nice:
            groups.set_nice(popen, launch.nice)
        return popen

    def _start(self) -> subprocess.Popen[bytes]:
        launch = self.launch
        argv = list(launch.argv)
        if sys.platform == "linux" and not launch.own_guard:
            argv = [sys.executable, "-I", "-S", parent_death.__file__, str(os.getpid()), *argv]
        return subprocess.Popen(
            argv,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=self._env,
            cwd=launch.cwd,
            bufsize=0,
            **groups.spawn_options(),
        )

    def _watch_death(self) -> None:
        if sys.platform == "linux":
            with contextlib.suppress(OSError, AttributeError):  # an old kernel, or a Python built without it
                descriptor = os.pidfd_open(self.pid)
                self._loop.add_reader(descriptor, self._died, descriptor)
                return
        future = self._loop.run_in_executor(None, self._popen.wait)
        future.add_done_callback(lambda _: self._died(None))

    def _died(self, descriptor: int | None) -> None:
        if descriptor is not None:
            self._loop.remove_reader(descriptor)
            os.close(descriptor)
        self.kill()  # what it left in its group
        if self._reaper is not None:
            self._reaper.group_ended(self.pid)
        self._reaped = True
        returncode = self._popen.wait()  # it is dead: this only reaps it, and only now may its number be used again
        self._output.finish()
        self.log.close()
        exit_ = Exit.from_returncode(returncode)
        if self.launch.clean_up:
            self._cleaning = self._loop.create_task(self._clean_up(exit_))
        else:
            self._end(exit_)

    async def _clean_up(self, exit_: Exit) -> None:
        await clean_up(self.launch.clean_up)
        self._end(exit_)

    def _end(self, exit_: Exit) -> None:
        if not self._ended.done():
            self._ended.set_result(exit_)


def _inherited() -> dict[str, str]:
    """Our environment, without what our own supervisor set for us alone."""
    return {name: value for name, value in os.environ.items() if name != HEARTBEAT}
