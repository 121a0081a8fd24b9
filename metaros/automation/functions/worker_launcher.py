"""Starts worker processes: forked from a warm zygote where the system can, else each as a new interpreter."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from metaros.automation.functions.launch import Confinement, Program, WorkerProcess, launch
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.sandbox.namespaces import API_PORT
from metaros.automation.functions.zygote import Zygote, zygote_works
from metaros.errors import LaunchError

__all__ = ["Launch", "WorkerLauncher"]

Launch = Callable[[Program, Confinement], Awaitable[WorkerProcess]]


class WorkerLauncher:
    """Keeps one fork server; one that died is replaced at the next start."""

    def __init__(self, level: Level, *, warm: bool = True) -> None:
        self._warm = warm and zygote_works() and level > Level.L0
        self._api = f"127.0.0.1:{API_PORT}" if level >= Level.L3 else ""  # elsewhere each worker's own port
        self._zygote: Zygote | None = None
        self._lock = asyncio.Lock()

    async def start(self) -> None:
        """Have the fork server ready."""
        if self._warm:
            await self._alive()

    async def close(self) -> None:
        """End it; whatever workers it still has end with it."""
        if self._zygote is not None:
            await self._zygote.close()

    async def __call__(self, program: Program, confinement: Confinement) -> WorkerProcess:
        """A worker's process.

        Raises:
            LaunchError: it cannot be had, or not so confined.
        """
        if not self._warm:
            return await launch(program, confinement)
        zygote = await self._alive()
        try:
            return await zygote.fork(program, confinement)
        except LaunchError:
            if zygote.alive:
                raise
        return await (await self._alive()).fork(program, confinement)

    async def _alive(self) -> Zygote:
        async with self._lock:
            if self._zygote is None or not self._zygote.alive:
                if self._zygote is not None:
                    await self._zygote.close()
                self._zygote = Zygote(api=self._api)
                await self._zygote.start()
            return self._zygote
