"""One worker: a process, its Runtime API and its log, from its start to its end."""

from __future__ import annotations

import asyncio
import contextlib
import math
import mmap
import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from metaros.automation.functions.calls import FunctionSpec, Outcome
from metaros.automation.functions.egress.proxy import EgressProxy
from metaros.automation.functions.launch import Usage, WorkerProcess
from metaros.automation.functions.log_pump import pump
from metaros.automation.functions.logs import LogPiece, WorkerLog
from metaros.automation.functions.running_call import RunningCall, platform_error
from metaros.automation.functions.runtime.runtime_api import Answer, RuntimeApi, event_head
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["InitFailure", "Worker", "WorkerOwner"]

MIB = 1024 * 1024
_MEMORY_EVERY_S = 0.05  # looks at a worker's memory at the ends of calls are so far apart
_PAGE_BYTES = mmap.PAGESIZE if sys.platform == "linux" else 0  # as its numbers are told


class WorkerOwner(Protocol):
    """Who owns a worker and is notified of it."""

    def free(self, worker: Worker) -> None:
        """It asks for a call."""

    def gone(self, worker: Worker) -> None:
        """It will take no call any more."""


class InitFailure(Exception):
    """The worker did not come to ask for a call; `timed_out` where it was only too slow."""

    def __init__(self, answer: Answer, *, timed_out: bool = False) -> None:
        super().__init__(answer.error_type)
        self.answer, self.timed_out = answer, timed_out


class Worker:
    """Runs one call at a time; call `run` only after `WorkerOwner.free` reported it idle.

    `egress` makes its proxy, if it has one, from a function that writes into its log."""

    def __init__(
        self,
        spec: FunctionSpec,
        launched: WorkerProcess,
        *,
        name: str,
        owner: WorkerOwner,
        emit: Callable[[LogPiece], None],
        clock: Clock,
        egress: Callable[[Callable[[str], None]], EgressProxy] | None = None,
        limits: Limits = LIMITS,
    ) -> None:
        self.spec, self.name = spec, name
        self.calls = 0
        self.idle_since_s = 0.0
        self.memory_bytes = self.peak_bytes = 0
        self.log_tail = b""  # of an init that failed
        self._launched, self._owner, self._clock, self._limits = launched, owner, clock, limits
        self._loop = asyncio.get_running_loop()
        self._api = RuntimeApi(self, limits=limits)
        self._log = WorkerLog(spec, name, emit=emit, clock=clock, limits=limits)
        self._egress = egress(self._log.note) if egress is not None else None
        self._running: RunningCall | None = None
        self._ready: asyncio.Future[None] = self._loop.create_future()
        self._ended: asyncio.Future[int] = self._loop.create_future()
        self._deadline_s = 0.0
        self._deadline: asyncio.TimerHandle | None = None
        self._looked_s = 0.0
        self._suspected = False  # its last look was of another call's time, and too much
        self._away = False  # its owner knows that it is gone
        ends = ((launched.logs, self._log.framed), (launched.output, self._log.plain))
        pipes = {fd: take for fd, take in ends if fd is not None}
        self._pump = pump(self._loop, pipes, bytes_per_s=limits.function_log_bytes_per_s)
        self._waiter = self._loop.create_task(self._wait(), name=f"function-worker-{name}")

    @property
    def busy(self) -> bool:
        """Whether it has a call."""
        return self._running is not None

    @property
    def launched(self) -> WorkerProcess:
        """Its process."""
        return self._launched

    async def start(self, *, within_s: float) -> None:
        """Serve its Runtime API until it asks for its first call.

        Raises:
            InitFailure: it does not; its process is killed.
        """
        listener, self._launched.listener = self._launched.listener, None
        assert listener is not None, "a worker is started once"
        server = await self._loop.create_server(self._api.connection, sock=listener)
        self._ended.add_done_callback(lambda _: server.close())
        if self._egress is not None and (way_out := self._launched.egress) is not None:
            self._launched.egress = None
            await self._egress.start(way_out)
        try:
            async with asyncio.timeout(within_s):
                await asyncio.shield(self._ready)
            if self._away:  # it asked, and ended
                raise InitFailure(
                    platform_error(self.name, "Runtime.ExitError", "Runtime exited before its first call")
                )
        except TimeoutError:
            message = f"the init did not end within {within_s:.2f} seconds"
            raise InitFailure(platform_error(self.name, "Sandbox.Timeout", message), timed_out=True) from None
        finally:
            if not self._ready.done() or self._ready.exception() is not None:
                self._ready.cancel()
                self._pump.drain()
                self.log_tail = self._log.end("")
                self._leave()

    def run(self, running: RunningCall) -> None:
        """Give it a call."""
        self._running = running
        call, spec = running.call, self.spec
        running.began_s = self._clock.monotonic_s()
        deadline_ms = self._clock.wall_ns() // 1_000_000 + math.ceil(spec.timeout_s * 1000)
        self._deadline_s = self._loop.time() + spec.timeout_s
        if self._deadline is None:
            self._deadline = self._loop.call_at(self._deadline_s, self._at_deadline)
        self._log.begin(call.request_id)
        head = event_head(call, arn=call.arn or spec.arn, deadline_ms=deadline_ms)
        self._api.give(head, call, stream=running.stream)

    def kill_with_error(self, error_type: str, message: str) -> None:
        """Kill it: its call ends with that error now."""
        if self._running is not None:
            self._end(platform_error(self._running.call.request_id, error_type, message))
        self._leave()

    def abandon(self, error: Exception) -> None:
        """Kill it; its call's caller gets `error`."""
        if self._running is not None:
            running, self._running = self._running, None
            running.fail(error)
        self._leave()

    async def stop(self) -> None:
        """End it in good order where it can, else after `function_stop_s` by force. It must have no call."""
        self._report_owner()
        self._pump.close()  # what it writes now is noise of its end
        if not self._ended.done() and sys.platform != "win32":
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(self._launched.pid, signal.SIGTERM)
        self._api.close()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self._limits.function_stop_s):
                await asyncio.shield(self._ended)
        await self.kill()

    async def kill(self) -> None:
        """End it by force; nothing of it is left."""
        self._leave()
        await self.over()

    async def over(self) -> None:
        """Wait until nothing of it is left."""
        await asyncio.shield(self._waiter)

    def look(self, usage: Usage, *, calls: int) -> None:
        """What it used when it had answered so many calls; what is over its limits ends it.

        Another call does not pay for what one before it may have given back meanwhile: of that the next look decides.
        """
        self.memory_bytes = usage.memory_bytes
        self.peak_bytes = max(self.peak_bytes, usage.memory_bytes)
        excess, suspected = self._excess(usage), self._suspected
        self._suspected = excess is not None and calls != self.calls
        if excess is not None and (suspected or not self._suspected):
            self.kill_with_error(*excess)

    def _excess(self, usage: Usage) -> tuple[str, str] | None:
        """What is over its limits: the error's type, and the words."""
        if usage.memory_bytes > self.spec.memory_mb * MIB:
            return "Runtime.OutOfMemory", f"Runtime exited: its memory is over {self.spec.memory_mb} MB"
        if usage.disk_bytes > self.spec.disk_mb * MIB:
            return "Sandbox.Failure", f"its temporary files are over {self.spec.disk_mb} MB"
        return None

    # Callbacks of its Runtime API.

    def on_ready(self) -> None:
        """It asks for a call."""
        if not self._ready.done():
            self._ready.set_result(None)
        self._owner.free(self)

    def on_answer(self, answer: Answer) -> None:
        """It is done with its call."""
        self._pump.drain()
        self._end(answer)

    def on_init_error(self, answer: Answer) -> None:
        """It never will ask."""
        if not self._ready.done():
            self._ready.set_exception(InitFailure(answer))

    def on_lost(self) -> None:
        """It broke off its request for a call: it is of no use."""
        if not self._away:
            self._leave()

    def _end(self, answer: Answer) -> None:
        running, self._running = self._running, None
        if running is None:
            return
        self.calls += 1
        now_s = self._clock.monotonic_s()
        duration_ms = (now_s - running.began_s) * 1000
        self._sample_memory(now_s)
        failed = answer.error_type
        if running.stream is not None and not failed:
            running.stream.feed(answer.body)  # of an answer that came at once
        tail = self._log.end(self._report(running, duration_ms, answer))
        running.settle(
            Outcome(
                payload=b"" if running.stream is not None and not failed else answer.body,
                error_type=failed,
                duration_ms=duration_ms,
                init_ms=running.init_ms,
                max_memory_mb=-(-self.peak_bytes // MIB),
                log=tail,
                content_type=answer.content_type,
            )
        )

    def _report(self, running: RunningCall, duration_ms: float, answer: Answer) -> str:
        request_id = running.call.request_id
        init = f"\tInit Duration: {running.init_ms:.2f} ms" if running.init_ms else ""
        status = f"\tStatus: error\tError Type: {answer.error_type}" if answer.error_type else ""
        timed_out = answer.error_type == "Sandbox.Timeout"
        note = f"{request_id} Task timed out after {self.spec.timeout_s:.2f} seconds\n" if timed_out else ""
        return (
            f"{note}END RequestId: {request_id}\n"
            f"REPORT RequestId: {request_id}\tDuration: {duration_ms:.2f} ms"
            f"\tBilled Duration: {math.ceil(duration_ms)} ms\tMemory Size: {self.spec.memory_mb} MB"
            f"\tMax Memory Used: {-(-self.peak_bytes // MIB)} MB{init}{status}\n"
        )

    def _sample_memory(self, now_s: float) -> None:
        """Between two looks of the watch, and cheaper: of the process alone."""
        if _PAGE_BYTES and now_s - self._looked_s >= _MEMORY_EVERY_S and not self._ended.done():
            self._looked_s = now_s
            with contextlib.suppress(OSError, ValueError, IndexError):
                pages = Path(f"/proc/{self._launched.pid}/statm").read_bytes().split()
                self.peak_bytes = max(self.peak_bytes, (int(pages[1]) - int(pages[2])) * _PAGE_BYTES)

    def _at_deadline(self) -> None:
        """One timer serves many calls: it looks whose time it is when it fires. It is also for who has answered and
        asks for no other call.
        """
        self._deadline = None
        if self._api.waits:
            return
        if self._loop.time() < self._deadline_s:
            self._deadline = self._loop.call_at(self._deadline_s, self._at_deadline)
            return
        self._pump.drain()
        self.kill_with_error("Sandbox.Timeout", f"Task timed out after {self.spec.timeout_s:.2f} seconds")

    async def _wait(self) -> None:
        """Until the process is no more."""
        status = await self._launched.wait()
        self._pump.drain()
        self._ended.set_result(status)
        how = f"signal: {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
        answer = platform_error(self.name, "Runtime.ExitError", f"Runtime exited with error: {how}")
        if not self._ready.done():
            self._ready.set_exception(InitFailure(answer))
        self.kill_with_error("Runtime.ExitError", f"Runtime exited with error: {how}")
        self._pump.close()
        self._launched.close()
        if self._egress is not None:
            await self._egress.close()
        await asyncio.to_thread(shutil.rmtree, self._launched.tmp_dir, ignore_errors=True)

    def _leave(self) -> None:
        """No call any more; the process is killed, its end is waited for elsewhere."""
        self._report_owner()
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
        self._api.close()
        if not self._ended.done():
            self._launched.kill()

    def _report_owner(self) -> None:
        if not self._away:
            self._away = True
            self._owner.gone(self)
