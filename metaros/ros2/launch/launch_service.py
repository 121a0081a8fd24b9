"""The launch service: visits what a launch file describes, and what its events bring, until nothing is left to do."""

from __future__ import annotations

import asyncio
import os
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from metaros.concurrency.signals import on_stop
from metaros.ros2.launch.entities import LaunchDescription, LaunchDescriptionEntity
from metaros.ros2.launch.events import Shutdown
from metaros.ros2.launch.launch_context import LaunchContext
from metaros.ros2.launch.runner import Runner

__all__ = ["LaunchService"]


class LaunchService:
    """`include_launch_description(…)`, then `run()`. Lines go to `out`, by default to the standard output."""

    def __init__(
        self,
        *,
        argv: Sequence[str] | None = None,
        noninteractive: bool = False,
        debug: bool = False,
        out: Callable[[str], object] | None = None,
    ) -> None:
        self.context = LaunchContext(argv=argv, noninteractive=noninteractive)
        self._debug = debug
        self._out = out or _print
        self._first: list[LaunchDescriptionEntity] = []
        self._events: deque[Any] = deque()
        self._changed: asyncio.Event | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._runner: Runner | None = None
        self._asked = threading.Event()
        self._failed = False

    def include_launch_description(self, launch_description: LaunchDescription) -> None:
        """Visit it, too; before the run or during it."""
        self._first.append(launch_description)
        self._wake()

    def emit_event(self, event: Any) -> None:
        """Tell the handlers an event."""
        self._emit(event)

    def shutdown(self, force_sync: bool = False) -> None:
        """End the launch; from any thread."""
        self._asked.set()
        self._emit(Shutdown(reason="LaunchService.shutdown() was called"))

    def run(self, *, shutdown_when_idle: bool = True) -> int:
        """Run to the end; 0, or 1 where the launch itself failed."""
        return asyncio.run(self.run_async(shutdown_when_idle=shutdown_when_idle))

    async def run_async(self, *, shutdown_when_idle: bool = True) -> int:
        """The same on an event loop."""
        self._loop = self.context.asyncio_loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()
        self._runner = runner = Runner(emit=self._emit, visit=self._visit, log_dir=_log_dir(), out=self._out)
        self.context.runner = runner
        if threading.current_thread() is threading.main_thread():
            on_stop(self._loop, self._on_signal)
        try:
            while True:
                self._work()
                if self.context.is_shutdown and not runner.busy:
                    break
                if shutdown_when_idle and not (runner.busy or self._events or self._first):
                    break
                await self._changed_or_idle(runner)
        finally:
            runner.shut_down()
            await runner.close()
            self._work()
        return 1 if self._failed else 0

    async def _changed_or_idle(self, runner: Runner) -> None:
        """Until something happened. Tasks end without an event of their own, therefore it looks now and then."""
        assert self._changed is not None
        try:
            await asyncio.wait_for(self._changed.wait(), 0.1)
        except TimeoutError:
            return
        self._changed.clear()

    def _work(self) -> None:
        while self._first or self._events:
            if self._first:
                self._visit(self._first.pop(0))
                continue
            event = self._events.popleft()
            if isinstance(event, Shutdown):
                self._end(event)
            for handler in self.context.handlers_of(event):
                for entity in handler.handle(event, self.context):
                    self._visit(entity)

    def _visit(self, entity: LaunchDescriptionEntity) -> None:
        """The entity and, before its neighbours, all that comes in its place."""
        pending = [entity]
        while pending:
            current = pending.pop(0)
            try:
                pending[:0] = current.visit(self.context) or []
            except Exception as error:
                if self._debug:
                    raise
                self._failed = True
                assert self._runner is not None
                self._runner.say("ERROR", "launch", f"{type(error).__name__}: {error}")
                self._emit(Shutdown(reason=f"{type(error).__name__}: {error}"))
                return

    def _end(self, event: Shutdown) -> None:
        assert self._runner is not None
        if not self.context.is_shutdown:
            self.context.is_shutdown = True
            self._runner.shut_down()

    def _on_signal(self) -> None:
        """The second one kills."""
        assert self._runner is not None
        if self.context.is_shutdown or self._asked.is_set():
            self._runner.kill()
        self._asked.set()
        self._emit(Shutdown(reason="it was asked to end by a signal", due_to_sigint=True))

    def _emit(self, event: Any) -> None:
        self._events.append(event)
        self._wake()

    def _wake(self) -> None:
        if self._loop is not None and self._changed is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._changed.set)


def _log_dir() -> Path:
    """ROS_LOG_DIR, else a folder of this launch alone."""
    given = os.environ.get("ROS_LOG_DIR")
    if given:
        path = Path(given) / f"launch_{os.getpid()}"
        path.mkdir(parents=True, exist_ok=True)
        return path
    return Path(tempfile.mkdtemp(prefix="metaros-launch-"))


def _print(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()
