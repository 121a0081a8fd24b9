"""The engine, started when it is first needed: a gateway without functions has no fork server and probes nothing."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path

from gateway.automation.functions.errors import FunctionsOffError
from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.automation.functions.engine import Engine, EngineStatus
from metaros.automation.functions.errors import EngineClosedError
from metaros.automation.functions.logs import LogPiece
from metaros.clock import Clock
from metaros.errors import MetarosError

__all__ = ["LazyEngine", "RuntimeState"]

log = logging.getLogger(__name__)
AGAIN_S = 10.0  # after a start that failed


@dataclass(frozen=True, slots=True)
class RuntimeState:
    """`status` is None before the engine's start, and where it does not start: `trouble` says why."""

    status: EngineStatus | None
    trouble: str


START_S = 90.0  # each level is tried once, for as long as a worker may take to start


class LazyEngine:
    """Runs calls as the engine does. All methods on the event loop."""

    def __init__(self, make: Callable[[], Engine] | None, *, on_log: Callable[[LogPiece], None], clock: Clock) -> None:
        """`make` None: functions are off here."""
        self._make = make
        self._on_log = on_log
        self._clock = clock
        self._engine: Engine | None = None
        self._starting = asyncio.Lock()
        self._trouble = "" if make is not None else "functions are off here (--no-functions)"
        self._failed_s = -AGAIN_S
        self._closed = False
        self._folders: dict[str, tuple[Path, ...]] = {}  # by the key of what was called

    async def invoke(self, spec: FunctionSpec, call: Invocation) -> Outcome:
        """Run one call. Besides what the engine raises FunctionsOffError."""
        engine = self._engine or await self.open()
        self._folders.setdefault(spec.key, (spec.code_dir, *spec.layer_dirs))
        return await engine.invoke(spec, call)

    async def stream(self, spec: FunctionSpec, call: Invocation) -> AsyncIterator[bytes | Outcome]:
        """Run one call, its answer piece by piece."""
        engine = self._engine or await self.open()
        self._folders.setdefault(spec.key, (spec.code_dir, *spec.layer_dirs))
        async for piece in engine.stream(spec, call):
            yield piece

    async def open(self) -> Engine:
        """The engine, started. Raises FunctionsOffError, EngineClosedError."""
        async with self._starting:
            if self._closed:
                raise EngineClosedError("the gateway ends")
            if self._engine is None:
                self._engine = await self._start()
            return self._engine

    def peek(self) -> Engine | None:
        """The engine, where it was started."""
        return self._engine

    def in_use(self) -> set[Path]:
        """The folders of code that workers have, or may have."""
        engine = self._engine
        keys = {pool.key for pool in engine.status().pools} if engine is not None else set()
        self._folders = {key: folders for key, folders in self._folders.items() if key in keys}
        return {folder for folders in self._folders.values() for folder in folders}

    def state(self) -> RuntimeState:
        """How it is."""
        engine = self._engine
        return RuntimeState(engine.status() if engine is not None else None, self._trouble)

    async def close(self) -> None:
        """End every worker; calls that are under way end as EngineClosedError."""
        async with self._starting:
            self._closed = True
            engine, self._engine = self._engine, None
        if engine is not None:
            await engine.close()

    async def _start(self) -> Engine:
        now_s = self._clock.monotonic_s()
        if self._make is None or now_s - self._failed_s < AGAIN_S:
            raise FunctionsOffError(self._trouble)
        engine = self._make()
        try:
            async with asyncio.timeout(START_S):  # all calls wait for it, and so does the gateway's end
                await engine.start()
        except (MetarosError, OSError) as error:
            self._failed_s, self._trouble = now_s, str(error) or type(error).__name__
            log.error("functions cannot run here: %s", self._trouble)
            raise FunctionsOffError(self._trouble) from error
        self._trouble = ""
        engine.on_log(self._on_log)
        return engine
