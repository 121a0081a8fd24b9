"""Runs replays: events of a span are delivered once more, at their own pace, resumable, each once a replay."""

from __future__ import annotations

import asyncio
import functools
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

from gateway.automation.queue.database import Database, read_snapshot
from gateway.domain.automation.delivery import Put
from gateway.domain.automation.gateway_event import GatewayEvent, Replay
from gateway.domain.errors import QueueFullError
from gateway.errors import StoreError, TooManyError
from gateway.store.automation.deliveries import Ready, put
from gateway.store.automation.gateway_events import Cursor, read_gateway_events
from gateway.store.automation.replays import add_replay, advance_replay, end_replay, read_replay, read_replays
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import Limits

__all__ = ["FAILED", "STOPPED", "Match", "PutAgain", "ReplayRunner"]

log = logging.getLogger(__name__)

Match = Callable[[GatewayEvent], bool]
PutAgain = Callable[[GatewayEvent], Sequence[Put]]

FAILED, STOPPED = "replay_failed", "stopped"
PAGE = 50  # events of one transaction
AGAIN_S = 1.0


class ReplayRunner:
    """The replays of this gateway; `notify` is told of what they put."""

    def __init__(
        self, database: Database, *, clock: Clock, limits: Limits, notify: Callable[[Sequence[Ready]], None]
    ) -> None:
        self._database = database
        self._clock = clock
        self._limits = limits
        self._notify = notify
        self._running: dict[str, asyncio.Task[None]] = {}

    async def begin(self, replay: Replay, match: Match, put_again: PutAgain) -> Replay:
        """Begin a replay, or go on with the one of that id where it was; nothing, where that has ended or goes on.

        Raises:
            TooManyError: too many go on.
        """
        now_ns = self._clock.wall_ns()
        if replay.id not in self._running and len(self._running) >= self._limits.replays_at_once:
            raise TooManyError(f"{self._limits.replays_at_once} replays go on already: replays_at_once")
        found = await self._database.run(lambda engine: add_replay(engine, replay, now_ns=now_ns))
        if not found.ended_ns and found.id not in self._running:
            task = asyncio.create_task(self._run(found, match, put_again))
            self._running[found.id] = task
            task.add_done_callback(lambda _: self._running.pop(found.id, None))
        return found

    async def stop(self, replay_id: str) -> bool:
        """End it as it is; False where it is over, or none."""
        now_ns = self._clock.wall_ns()
        return await self._database.run(lambda engine: end_replay(engine, replay_id, now_ns=now_ns, code=STOPPED))

    async def list(self) -> list[Replay]:
        """Those that go on (here, elsewhere, or since a restart nowhere), then those that ended, the newest first."""
        return await read_snapshot(
            self._database, lambda engine: read_replays(engine, limit=2 * self._limits.replays_kept)
        )

    async def close(self) -> None:
        """Leave them as they are: they can be gone on with."""
        tasks = list(self._running.values())
        for task in tasks:
            task.cancel()
        if tasks:
            await asyncio.wait(tasks)

    async def _run(self, replay: Replay, match: Match, put_again: PutAgain) -> None:
        while True:
            try:
                read = await self._page(replay, match, put_again)
            except (StoreError, QueueFullError) as error:
                log.debug("replay %s waits: %s", replay.id, error)
                await asyncio.sleep(AGAIN_S)
                continue
            except Exception:
                log.exception("replay %s failed", replay.id)
                await self._end(replay, FAILED)
                return
            if not read:
                return
            await asyncio.sleep(read / self._limits.replay_per_s)

    async def _page(self, replay: Replay, match: Match, put_again: PutAgain) -> int:
        """Put what is wanted of the next events; how many those were, 0 at the end."""

        def read(engine: StoreEngine) -> tuple[Cursor, list[tuple[Cursor, GatewayEvent]]] | None:
            found = read_replay(engine, replay.id)
            if found is None or found[0].ended_ns:
                return None
            return found[1], read_gateway_events(engine, replay.span, after=found[1], limit=PAGE)

        page = await read_snapshot(self._database, read)
        if page is None:
            return 0
        _, rows = page
        if not rows:
            await self._end(replay, "")
            return 0
        puts = [
            one for _, gateway_event in rows if match(gateway_event) for one in _again(replay, gateway_event, put_again)
        ]
        if await self._database.run(functools.partial(self._put, replay, rows[-1][0], len(rows), puts)):
            self._notify([Ready(one.kind, one.target, one.due_ns) for one in puts])
            return len(rows)
        return 0

    def _put(self, replay: Replay, cursor: Cursor, read: int, puts: Sequence[Put], engine: StoreEngine) -> bool:
        if not advance_replay(engine, replay.id, cursor, read=read, put=len(puts)):
            return False
        now_ns = self._clock.wall_ns()
        put(engine, puts, gateway=self._database.gateway_id, now_ns=now_ns, limits=self._limits)
        return True

    async def _end(self, replay: Replay, code: str) -> None:
        now_ns = self._clock.wall_ns()
        await self._database.run(lambda engine: end_replay(engine, replay.id, now_ns=now_ns, code=code))


def _again(replay: Replay, gateway_event: GatewayEvent, put_again: PutAgain) -> list[Put]:
    key = f"replay/{replay.id}/{gateway_event.source}/{gateway_event.id}"
    return [replace(one, dedup=f"{key}/{number}") for number, one in enumerate(put_again(gateway_event))]
