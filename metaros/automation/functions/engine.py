"""The engine: calls of functions in, outcomes out; its workers, bounded in number, memory and time."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import logging
import re
import secrets
import shutil
import sys
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.automation.functions.egress.proxy import Egress
from metaros.automation.functions.egress.rules import EGRESS, EgressRules, parse_egress
from metaros.automation.functions.environment import AUTO, check_runtime, environment_of, own_entry, worker_entry
from metaros.automation.functions.errors import ENGINE_FULL, RESERVED_FULL, EngineClosedError, ThrottledError
from metaros.automation.functions.launch import Confinement, Program, Usage
from metaros.automation.functions.logs import LogPiece
from metaros.automation.functions.pool import Pool, PoolStatus
from metaros.automation.functions.probe import require as require_level
from metaros.automation.functions.response_stream import ResponseStream
from metaros.automation.functions.running_call import RunningCall, platform_error
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.worker import InitFailure, Worker, WorkerOwner
from metaros.automation.functions.worker_launcher import Launch, WorkerLauncher
from metaros.clock import Clock
from metaros.errors import FieldError, LaunchError, TooLargeError
from metaros.limits import LIMITS, Limits

__all__ = ["Engine", "EngineStatus"]

log = logging.getLogger(__name__)

MIB = 1024 * 1024
_REQUEST_ID = re.compile(r"[A-Za-z0-9._-]{1,128}")
_CONTEXT_CHARS = 16_384


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineStatus:
    """The engine as it is seen. `reasons` says of each level "ok" or why it is not to be had here."""

    level: Level
    reasons: Mapping[Level, str]
    entry: str
    interpreter: str
    workers: int
    most_workers: int
    pools: tuple[PoolStatus, ...]


class Engine:
    """Runs functions in `folder`; belongs to the event loop on which it was started.

    `level` None takes the highest that works here; `require` is the lowest that will do. `entry` chooses the client of
    workers whose function says nothing of it. `launch` replaces what starts processes. `egress` bounds where functions
    may ask to connect to; None: anywhere.
    """

    def __init__(
        self,
        folder: Path,
        *,
        clock: Clock,
        level: Level | None = None,
        require: Level = Level.L0,
        entry: str = AUTO,
        most_workers: int | None = None,
        warm_start: bool = True,
        launch: Launch | None = None,
        egress: EgressRules | None = None,
        limits: Limits = LIMITS,
    ) -> None:
        self._tmp = folder / "tmp"
        self._clock, self._limits = clock, limits
        self._level, self._require = level, require
        self._reasons: Mapping[Level, str] = {}
        self._entry = own_entry(entry)
        self._most_workers = most_workers or limits.function_workers
        self._warm_start, self._launch = warm_start, launch
        self._egress = Egress(bound=egress, limits=limits)
        self._starter: WorkerLauncher | None = None
        self._pools: dict[str, Pool] = {}
        self._leaving: set[Pool] = set()  # retired, and not yet empty
        self._starved: dict[Pool, None] = {}  # wait for capacity for a worker, in this order
        self._in_flight: dict[str, int] = {}
        self._waiting_bytes = 0
        self._listeners: list[Callable[[LogPiece], None]] = []
        self._numbers = itertools.count(1)
        self._watch: asyncio.Task[None] | None = None
        self._closed = True
        self._loop: asyncio.AbstractEventLoop

    async def start(self) -> None:
        """Probe the level, have the fork server ready and the folder for temporary files empty.

        Raises:
            SandboxError: the least level is not to be had here.
            LaunchError: the fork server does not start.
        """
        self._loop = asyncio.get_running_loop()
        probe = await asyncio.to_thread(require_level, max(self._require, self._level or Level.L0))
        self._level = probe.level if self._level is None else self._level
        self._reasons = probe.reasons
        await asyncio.to_thread(shutil.rmtree, self._tmp, ignore_errors=True)
        if self._launch is None:
            self._starter = WorkerLauncher(self._level, warm=self._warm_start)
            await self._starter.start()
            self._launch = self._starter
        self._closed = False
        self._watch = self._loop.create_task(self._watching(), name="functions-watch")

    async def close(self) -> None:
        """End every worker; calls that are under way or wait end as EngineClosedError."""
        self._closed = True
        if self._watch is not None:
            self._watch.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._watch
        error = EngineClosedError("the engine of functions was closed while this call was under way")
        await asyncio.gather(*(pool.close(error) for pool in [*self._pools.values(), *self._leaving]))
        self._pools.clear()
        self._leaving.clear()
        self._egress.close()
        if self._starter is not None:
            await self._starter.close()
        await asyncio.to_thread(shutil.rmtree, self._tmp, ignore_errors=True)

    async def invoke(self, spec: FunctionSpec, call: Invocation) -> Outcome:
        """Run a call to its end. What the function does wrong is in the outcome. Cancelled, the call itself goes on.

        Raises:
            ThrottledError: there is no room for it.
            EngineClosedError: the engine is, or was closed meanwhile.
            RuntimeRefusedError, FieldError, TooLargeError: it cannot be run at all.
        """
        return await self._submit(spec, call, None).done

    async def stream(self, spec: FunctionSpec, call: Invocation) -> AsyncIterator[bytes | Outcome]:
        """The same piece by piece, as the function writes them; the outcome comes last, without them. Left early, the
        call itself goes on.
        """
        pieces = ResponseStream(self._loop, limits=self._limits)
        self._submit(spec, call, pieces)
        try:
            async for piece in pieces:
                yield piece
        finally:
            pieces.discard()

    def room(self, spec: FunctionSpec) -> int:
        """How many more calls it takes now without letting them wait for another call's end."""
        pool = self._pools.get(spec.key)
        rooms = [spec.max_workers - (pool.load if pool else 0), self._most_workers - self._in_flight_now()]
        if spec.reserved is not None:
            rooms.append(spec.reserved - self._in_flight.get(spec.name, 0))
        return 0 if self._closed else max(0, min(rooms))

    async def warm(self, spec: FunctionSpec) -> None:
        """Have `spec.min_workers` from now on, until it is retired."""
        self._check_open()
        self._pool(spec).tick(self._loop.time())

    async def retire(self, key: str) -> None:
        """Of this version no call any more: its idle workers end now, the others after their calls."""
        pool = self._pools.pop(key, None)
        if pool is not None:
            self._leaving.add(pool)
            pool.retire()

    def pids(self, key: str) -> list[int]:
        """The processes of this version's workers."""
        pool = self._pools.get(key)
        return sorted(worker.launched.pid for worker in pool.workers) if pool else []

    def status(self) -> EngineStatus:
        """How it is now."""
        assert self._level is not None, "the engine was not started"
        return EngineStatus(
            level=self._level,
            reasons=self._reasons,
            entry=self._entry,
            interpreter=f"python{sys.version_info.major}.{sys.version_info.minor}.{sys.version_info.micro}",
            workers=self._size(),
            most_workers=self._most_workers,
            pools=tuple(pool.status() for pool in self._all()),
        )

    def on_log(self, listener: Callable[[LogPiece], None]) -> Callable[[], None]:
        """Tell `listener` of all that functions write, as it comes; it must be quick. Returns what ends that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    # Admission.

    def _submit(self, spec: FunctionSpec, call: Invocation, stream: ResponseStream | None) -> RunningCall:
        self._check_open()
        call = self._checked(spec, call)
        in_flight = self._in_flight.get(spec.name, 0)
        if spec.reserved is not None and in_flight >= spec.reserved:
            message = f"{spec.name} runs {in_flight} calls, of {spec.reserved} reserved"
            raise ThrottledError(message, reason=RESERVED_FULL)
        size = len(call.payload)
        if self._waiting_bytes + size > self._limits.function_waiting_bytes:
            raise ThrottledError("calls that are under way hold all the memory there is for them", reason=ENGINE_FULL)
        running = RunningCall(spec, call, self._loop.create_future(), self._over, stream, self._loop.time())
        self._pool(spec).submit(running)
        self._in_flight[spec.name] = in_flight + 1
        self._waiting_bytes += size
        return running

    def _over(self, running: RunningCall) -> None:
        left = self._in_flight[running.spec.name] - 1
        if left:
            self._in_flight[running.spec.name] = left
        else:
            del self._in_flight[running.spec.name]
        self._waiting_bytes -= len(running.call.payload)

    def _checked(self, spec: FunctionSpec, call: Invocation) -> Invocation:
        """The call, as it can be sent in headers."""
        check_runtime(spec.runtime)
        if len(call.payload) > self._limits.function_payload_bytes:
            size, most = len(call.payload), self._limits.function_payload_bytes
            raise TooLargeError(f"payload: {size} bytes, at most {most}")
        if not _REQUEST_ID.fullmatch(call.request_id):
            raise FieldError("request_id: 1 to 128 letters, digits, dots, dashes and underscores")
        for name, text in (("arn", call.arn or spec.arn), ("trace_id", call.trace_id)):
            if not text.isascii() or (text and not text.isprintable()) or len(text) > 2048:
                raise FieldError(f"{name}: at most 2048 printable characters of ASCII")
        return replace(call, client_context=_one_line(call.client_context)) if call.client_context else call

    def _check_open(self) -> None:
        if self._closed:
            raise EngineClosedError("the engine of functions is closed")

    # Workers.

    def _pool(self, spec: FunctionSpec) -> Pool:
        pool = self._pools.get(spec.key)
        if pool is None:
            entry = worker_entry(spec, self._entry)
            pool = Pool(spec, entry=entry, quota=self, launch=self._worker, clock=self._clock, limits=self._limits)
            self._pools[spec.key] = pool
        elif pool.spec is not spec:
            pool.spec = spec  # its bounds may have changed: what its workers run has not
        return pool

    async def _worker(self, spec: FunctionSpec, owner: WorkerOwner) -> Worker:
        """A process for it, that is not served yet."""
        assert self._launch is not None
        assert self._level is not None
        name = f"{next(self._numbers):06d}{secrets.token_hex(13)}"
        try:
            rules = parse_egress(spec.environment.get(EGRESS, ""))
        except FieldError as error:
            raise InitFailure(platform_error(name, "Sandbox.InvalidEgress", str(error))) from error
        program = Program(
            handler=spec.handler,
            code_dir=spec.code_dir,
            layer_dirs=spec.layer_dirs,
            env=environment_of(spec, worker=name, clock=self._clock),
            entry=worker_entry(spec, self._entry),
            egress=bool(rules.patterns),
        )
        confinement = Confinement(
            level=self._level,
            tmp_dir=self._tmp / name,
            memory_mb=spec.memory_mb,
            disk_bytes=spec.disk_mb * MIB,
        )
        try:
            launched = await self._launch(program, confinement)
        except (LaunchError, OSError) as error:
            raise InitFailure(platform_error(name, "Sandbox.Failure", f"no worker: {error}")) from error
        return Worker(
            spec,
            launched,
            name=name,
            owner=owner,
            emit=self._emit,
            clock=self._clock,
            egress=partial(self._egress.proxy, rules) if rules.patterns else None,
            limits=self._limits,
        )

    def may_start(self, pool: Pool) -> bool:
        """Of a pool: whether one more worker has room; one that idles elsewhere makes it."""
        if self._closed:
            return False
        if self._size() < self._most_workers:
            self._starved.pop(pool, None)
            return True
        self._starved[pool] = None
        self._make_room()
        return False

    def released(self) -> None:
        """Of a pool: a worker is gone or idle; who starves has its turn."""
        if not self._starved or self._closed:
            return
        if self._size() >= self._most_workers:
            self._make_room()
            return
        pool = next(iter(self._starved))
        del self._starved[pool]
        if pool.waiting:
            pool.grow()

    def _make_room(self) -> None:
        """End the idle worker of the pool that was used least lately."""
        idle = [p for p in self._all() if p.idle and len(p.workers) > p.spec.min_workers and p not in self._starved]
        if idle:
            min(idle, key=lambda pool: pool.used_s).evict_idle()

    def _all(self) -> list[Pool]:
        return [*self._pools.values(), *self._leaving]

    def _size(self) -> int:
        return sum(pool.size for pool in self._all())

    def _in_flight_now(self) -> int:
        return sum(self._in_flight.values())

    def _emit(self, piece: LogPiece) -> None:
        for listener in self._listeners:
            try:
                listener(piece)
            except Exception:
                log.exception("a listener of the functions' log failed")

    # The watch.

    async def _watching(self) -> None:
        """What workers use, who idles and who waits for too long."""
        while True:
            await asyncio.sleep(self._limits.function_watch_s)
            try:
                await self._look()
            except Exception:
                log.exception("the watch of functions' workers failed; it goes on")

    async def _look(self) -> None:
        workers = [(worker, worker.calls) for pool in self._all() for worker in pool.workers]
        usages = await asyncio.to_thread(_usages, [worker for worker, _ in workers])
        for (worker, calls), usage in zip(workers, usages, strict=True):
            worker.look(usage, calls=calls)
        for pool in self._all():
            pool.tick(self._loop.time())
        self._forget()

    def _forget(self) -> None:
        """Pools of which nothing is left."""
        for pool in [pool for pool in self._leaving if pool.empty]:
            self._leaving.discard(pool)
        latest_s = self._loop.time() - self._limits.function_idle_s
        for key, pool in list(self._pools.items()):
            if pool.empty and not pool.spec.min_workers and pool.used_s < latest_s:
                del self._pools[key]


def _usages(workers: list[Worker]) -> list[Usage]:
    return [worker.launched.usage() for worker in workers]


def _one_line(client_context: str) -> str:
    try:
        text = json.dumps(json.loads(client_context), separators=(",", ":"))
    except (ValueError, RecursionError) as error:
        raise FieldError(f"client_context: no JSON: {error}") from error
    if len(text) > _CONTEXT_CHARS:
        raise FieldError(f"client_context: at most {_CONTEXT_CHARS} characters of JSON")
    return text
