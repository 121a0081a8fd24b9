"""The agent's connection to its supervisor: opened when needed, reopened when it breaks, notified of every change."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from edge_agent.nodes.errors import SupervisorError
from edge_agent.nodes.launcher import Launcher
from metaros.errors import ConfigError, MetarosError, UnavailableError
from metaros.supervise.client import SupervisorClient

__all__ = ["SupervisorConnection"]

LOG = logging.getLogger("metaros.agent.nodes")
START_S: Final = 60.0  # a cold start of Python on a small, busy robot
WATCH_S: Final = 20.0
PAUSE_S: Final = (0.2, 10.0)


class SupervisorConnection:
    """Follows the supervisor as long as `run` runs; `on_list` gets each new list, None where none runs."""

    def __init__(self, directory: Path, launcher: Launcher, on_list: Callable[[dict[str, Any] | None], None]) -> None:
        self._directory = directory
        self._launcher = launcher
        self._on_list = on_list
        self._client: SupervisorClient | None = None
        self._opening = asyncio.Lock()
        self._needed = asyncio.Event()

    async def ask(self, verb: str, *, timeout_s: float = 30.0, start: bool = True, **request: Any) -> dict[str, Any]:
        """One request; with `start` a supervisor is started where none runs. Raises SupervisorError, ConfigError."""
        try:
            client = await self._open(start=start)
            return await client.ask(verb, timeout_s=timeout_s, **request)
        except (ConfigError, SupervisorError):
            raise
        except UnavailableError as error:  # it may be ending this very moment
            raise SupervisorError(self._launcher.why_stopped or str(error)) from error
        except MetarosError as error:
            raise SupervisorError(str(error)) from error

    def need(self) -> None:
        """There is something for a supervisor to do: see that one runs."""
        self._needed.set()

    async def run(self) -> None:
        """Follow it for ever. Where its table has nodes it is started, by whoever of agent and system comes first."""
        pause_s = PAUSE_S[0]
        if self._launcher.has_table:
            self.need()
        while True:
            try:
                await self._follow(start=self._needed.is_set())
                pause_s = PAUSE_S[0]
            except MetarosError as error:
                LOG.debug("no supervisor: %s", error)
                self._on_list(None)
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, PAUSE_S[1])
            if not self._launcher.running and not self._needed.is_set():
                await self._needed.wait()

    async def close(self) -> None:
        """Hang up; the supervisor goes on."""
        if self._client is not None:
            await self._client.close()

    async def _follow(self, *, start: bool) -> None:
        client = await self._open(start=start)
        found = await client.ask("list")
        while True:
            self._on_list(found)
            if found["nodes"]:
                self.need()  # it has something to do: where it dies it is started again
            found = await client.ask(
                "list", since=found["revision"], life=found["life"], wait_s=WATCH_S, timeout_s=WATCH_S + 30.0
            )

    async def _open(self, *, start: bool) -> SupervisorClient:
        async with self._opening:
            if self._client is not None and not self._client.closed:
                return self._client
            if self._client is not None:
                await self._client.close()
                self._client = None
            self._client = await self._connected(start=start)
            return self._client

    async def _connected(self, *, start: bool) -> SupervisorClient:
        loop = asyncio.get_running_loop()
        deadline = loop.time() + START_S
        started = start and self._launcher.start()
        while True:
            try:
                return await SupervisorClient.open(self._directory)
            except UnavailableError:
                if (not self._launcher.running and not start) or loop.time() > deadline:
                    raise
            await asyncio.sleep(0.05)
            if start and not self._launcher.running and not self._launcher.starting:
                if started:
                    raise UnavailableError(f"the supervisor ended at once: see {self._directory / 'supervisor.log'}")
                started = self._launcher.start()  # the one that ran was about to end
