"""`metaros launch` at work: host or join the router, keep the table's nodes running, take requests, stop.

One event loop; the supervisor's events, the nodes' output, signals and requests arrive on it.
"""

from __future__ import annotations

import asyncio
import os
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from metaros.cli.launch.graph import LaunchGraph
from metaros.cli.launch.plan import ALL_NODES, PROGRAM, Place, launches, node_names
from metaros.clock import Clock
from metaros.concurrency.signals import on_stop
from metaros.errors import UsageError
from metaros.supervise import Event, EventKind, LaunchTable, Supervisor
from metaros.supervise.spare import Spare

if TYPE_CHECKING:
    from random import Random  # noqa: TID251  (the type of an argument)

    from metaros.cli.launch.screen import Screen

__all__ = ["run"]

STOP_GRACE_S = 5.0
SAFE_STOP_S = 10.0
REFRESH_S = 0.5


async def run(table: LaunchTable, place: Place, screen: Screen, *, clock: Clock, rng: Random) -> bool:
    """Start everything, stay until asked to stop or until nothing is left to run; leave nothing behind.

    True where nothing is left to run and something failed.
    """
    return await _Run(table, place, screen, clock=clock, rng=rng).run()


class _Run:
    def __init__(self, table: LaunchTable, place: Place, screen: Screen, *, clock: Clock, rng: Random) -> None:
        self._table, self._place, self._screen = table, place, screen
        self._names = node_names(table)
        self._stop = asyncio.Event()
        self._safe_stops: set[asyncio.Task[None]] = set()
        self._graph = LaunchGraph(
            zenoh_port=place.zenoh_port, domain=place.domain, name=f"launch_{os.getpid()}", answer=self._answer
        )
        self._supervisor = Supervisor(
            clock=clock,
            rng=rng,
            on_event=self._on_event,
            on_line=screen.line,
            is_ready=self._is_ready,
            spare=Spare((*PROGRAM, "spare"), cwd=table.folder, env={**ALL_NODES, **table.env}) if table.spare else None,
        )

    async def run(self) -> bool:
        """The whole life."""
        on_stop(asyncio.get_running_loop(), self._ask_stop, hangup=True)
        try:
            self._supervisor.start(launches(self._table, self._place))
            while not self._stop.is_set():
                rows = self._supervisor.status()
                self._screen.refresh(rows)
                if all(row.state == "ended" for row in rows):
                    return any(row.last_exit != "exited" for row in rows)
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._stop.wait(), REFRESH_S)
            return False
        finally:
            self._screen.stopping()
            await self._supervisor.stop(grace_s=STOP_GRACE_S)
            self._screen.stopped(self._supervisor.status())
            for task in self._safe_stops:
                task.cancel()
            self._graph.close()

    def _ask_stop(self) -> None:
        """The first request ends all in order, a second one at once."""
        if self._stop.is_set():
            self._supervisor.kill()
        self._stop.set()

    def _is_ready(self, name: str) -> bool:
        return name not in self._names or self._graph.has_node(self._names[name])

    def _on_event(self, event: Event) -> None:
        self._graph.report(event, self._names.get(event.name, event.name))
        tail = self._supervisor.tail(event.name) if event.kind is EventKind.EXITED else []
        self._screen.event(event, tail)
        if event.kind is EventKind.SAFE_STOP:
            task = asyncio.get_running_loop().create_task(self._safe_stop(event.name))
            self._safe_stops.add(task)
            task.add_done_callback(self._safe_stops.discard)

    # -- safe stop -------------------------------------------------------------------------------------------------

    async def _safe_stop(self, name: str) -> None:
        """Bring the machine to rest: the table's command and service, both where both are given."""
        if self._table.safe_stop_service:
            problem = await self._graph.trigger(self._table.safe_stop_service, SAFE_STOP_S)
            self._screen.note(f"safe stop ({name}): {problem or f'{self._table.safe_stop_service} called'}")
        if self._table.safe_stop:
            problem = await asyncio.to_thread(self._safe_stop_command, name)
            self._screen.note(f"safe stop ({name}): {problem or ' '.join(self._table.safe_stop)}")
        if not (self._table.safe_stop or self._table.safe_stop_service):
            self._screen.note(f"safe stop wanted ({name}), but the table has no safe_stop and no safe_stop_service")

    def _safe_stop_command(self, name: str) -> str:
        env = {**os.environ, "METAROS_NODE": name, "METAROS_ZENOH_PORT": str(self._place.zenoh_port)}
        try:
            done = subprocess.run(
                self._table.safe_stop,
                cwd=self._table.folder,
                env=env,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=SAFE_STOP_S,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            return f"failed: {error}"
        return "" if done.returncode == 0 else f"failed with exit code {done.returncode}"

    # -- requests from other terminals -----------------------------------------------------------------------------

    async def _answer(self, request: Mapping[str, Any]) -> dict[str, Any]:
        what, name = request.get("do", "status"), request.get("node", "")
        if what == "restart":
            self._supervisor.restart(str(name))
        elif what == "stop":
            await self._supervisor.stop_one(str(name))
        elif what != "status":
            raise UsageError(f"a launcher can status, restart and stop, not {str(what)[:40]}")
        return {"table": str(self._table.path), "pid": os.getpid(), "nodes": self._rows()}

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {
                "name": row.name,
                "node": self._names.get(row.name, ""),
                "state": row.state,
                "pid": row.pid,
                "restarts": row.restarts,
                "last_exit": row.last_exit,
                "waits_for": row.waits_for,
                "critical": row.critical,
            }
            for row in self._supervisor.status()
        ]
