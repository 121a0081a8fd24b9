"""What a launch has running: processes, timers, coroutines. All on one event loop."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from metaros.errors import ConfigError
from metaros.ros2.launch.events import ExecutionComplete, TimerEvent
from metaros.ros2.launch.events.process import ProcessExited, ProcessIO, ProcessStarted
from metaros.supervise.orphan_reaper import OrphanReaper
from metaros.supervise.process import Launch, Process

__all__ = ["Runner"]

_CANNOT_START = 127


class Runner:
    """Starts and ends what actions ask for, and tells `emit` what becomes of it.

    Each process is a group of its own that dies with this program; its lines are in a file of `log_dir` and, where
    asked for, on the screen with its name before them.
    """

    def __init__(
        self, *, emit: Callable[[Any], None], visit: Callable[[Any], None], log_dir: Path, out: Callable[[str], object]
    ) -> None:
        self.emit = emit
        self.log_dir = log_dir
        self.first_environment = dict(os.environ)
        self.misunderstood: list[str] = []
        self._visit = visit
        self._out = out
        self._tasks: set[asyncio.Task[None]] = set()
        self._beside: set[asyncio.Future[Any]] = set()  # what nobody need wait for
        self._processes: dict[Any, Process] = {}
        self._timeouts_s: dict[Any, tuple[float, ...]] = {}
        self._numbers = 0
        self._ending = asyncio.Event()
        self._reaper = OrphanReaper()
        self.node: Any = None  # the launch's own, where it has one
        self._at_end: list[Callable[[], object]] = []

    @property
    def busy(self) -> bool:
        """Whether anything is still to come of what was started."""
        return bool(self._tasks)

    def say(self, level: str, name: str, text: str) -> None:
        """A line of the launch itself."""
        self._out(f"[{level}] [{name}]: {text}")

    def not_understood(self, what: str) -> None:
        """Say once that something of the launch file has no effect here."""
        if what not in self.misunderstood:
            self.misunderstood.append(what)
            self.say("WARNING", "launch", f"not understood, and left out: {what}")

    # -- beside the rest -------------------------------------------------------------------------------------------

    def run_beside(self, action: Any, work: Awaitable[Any]) -> None:
        """Await it while the launch goes on; it is cancelled when that is to end."""

        awaited = asyncio.ensure_future(work)
        self._beside.add(awaited)
        awaited.add_done_callback(self._beside.discard)

        async def run() -> None:
            try:
                await awaited
            except Exception as error:
                self.say("ERROR", "launch", f"{type(error).__name__}: {error}")
            self.emit(ExecutionComplete(action=action))

        self._keep(run())

    def after(self, action: Any, period_s: float, entities: Callable[[], Sequence[Any]]) -> None:
        """Visit entities later, unless the launch ends before."""

        async def wait() -> None:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._ending.wait(), period_s)
                return
            self.emit(TimerEvent(timer_action=action))
            for entity in entities():
                self._visit(entity)
            self.emit(ExecutionComplete(action=action))

        self._keep(wait())

    def _keep(self, work: Any) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # -- processes -------------------------------------------------------------------------------------------------

    def start(
        self,
        action: Any,
        *,
        argv: Sequence[str],
        called: str,
        env: dict[str, str],
        cwd: str | None,
        on_screen: bool,
        respawn: bool,
        timeouts_s: tuple[float, ...],
    ) -> None:
        """Start a process, and start it again when it ends, where that is asked."""
        if not argv:
            raise ConfigError("a process without a command")
        self._numbers += 1
        name = f"{called}-{self._numbers}"
        launch = Launch(
            name=name,
            argv=tuple(argv),
            log_path=self.log_dir / f"{name}.log",
            env=env,
            cwd=Path(cwd) if cwd else None,
        )
        self._timeouts_s[action] = timeouts_s
        self._keep(self._run(action, launch, on_screen=on_screen, respawn=respawn))

    async def _run(self, action: Any, launch: Launch, *, on_screen: bool, respawn: bool) -> None:
        while not self._ending.is_set():
            try:
                code = await self._run_once(action, launch, on_screen=on_screen)
            except OSError as error:
                self.say("ERROR", launch.name, f"cannot be started: {error.strerror}: {launch.argv[0]}")
                code = _CANNOT_START
            action.return_code = code
            if not respawn:
                break
            with suppress(TimeoutError):
                await asyncio.wait_for(self._ending.wait(), action.respawn_delay_s)
        self.emit(ExecutionComplete(action=action))

    async def _run_once(self, action: Any, launch: Launch, *, on_screen: bool) -> int:
        details: dict[str, Any] = {
            "action": action,
            "process_name": launch.name,
            "cmd": list(launch.argv),
            "cwd": str(launch.cwd) if launch.cwd else None,
            "env": dict(launch.env),
        }

        def line(text: str) -> None:
            if on_screen:
                self._out(f"[{launch.name}] {text}")
            self.emit(ProcessIO(pid=process.pid, text=f"{text}\n".encode(), **details))

        process = Process(launch, on_line=line, reaper=self._reaper)
        self._processes[action] = process
        action.process_details = {**details, "name": launch.name, "pid": process.pid}
        self.say("INFO", launch.name, f"process started with pid [{process.pid}]")
        self.emit(ProcessStarted(pid=process.pid, **details))
        try:
            ended = await process.wait()
        finally:
            self._processes.pop(action, None)
            action.process_details = None
        code = -ended.signal if ended.signal is not None else ended.code or 0
        self._tell_end(launch.name, process, code, on_screen=on_screen)
        self.emit(ProcessExited(pid=process.pid, returncode=code, **details))
        return code

    def _tell_end(self, name: str, process: Process, code: int, *, on_screen: bool) -> None:
        if code == 0 or self._ending.is_set():
            self.say("INFO", name, f"process has finished [pid {process.pid}, exit code {code}]")
            return
        if not on_screen:
            for text in process.log.tail():
                self._out(f"[{name}] {text}")
        self.say(
            "ERROR",
            name,
            f"process has died [pid {process.pid}, exit code {code}], its log is {process.launch.log_path}",
        )

    def send(self, action: Any, number: int) -> None:
        """A signal to an action's process, if it runs."""
        process = self._processes.get(action)
        if process is not None:
            process.send(number)

    def end(self, action: Any) -> None:
        """Ask an action's process to end; more and more firmly."""
        process = self._processes.get(action)
        if process is not None:
            self._keep(self._end(process, self._timeouts_s[action]))

    async def _end(self, process: Process, timeouts_s: tuple[float, ...]) -> None:
        process.ask_to_end()
        for timeout_s, harder in zip(timeouts_s, (process.terminate, process.kill_if_running), strict=True):
            with suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), timeout_s)
                return
            harder()

    # -- the end ---------------------------------------------------------------------------------------------------

    def shut_down(self) -> None:
        """Ask everything to end."""
        if not self._ending.is_set():
            self._ending.set()
            for action in list(self._processes):
                self.end(action)
            for awaited in list(self._beside):
                awaited.cancel()

    def at_end(self, call: Callable[[], object]) -> None:
        """Call this when nothing runs any more."""
        self._at_end.append(call)

    def kill(self) -> None:
        """The impatient end."""
        for process in self._processes.values():
            process.kill_if_running()

    async def close(self) -> None:
        """Wait for what is left, cancelling what is no process."""
        for process in list(self._processes.values()):
            await process.wait()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._reaper.close()
        for call in self._at_end:
            await asyncio.to_thread(call)
