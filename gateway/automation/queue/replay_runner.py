"""Delivering once more what happened in a span of time: at its own pace, resumable, each happening once a replay."""

from __future__ import annotations

import asyncio
import functools
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

from gateway.domain.delivery import Put
from gateway.domain.errors import QueueFullError
from gateway.domain.happening import Happening, Replay
from gateway.errors import StoreError, TooManyError
from gateway.queue.database import Database, look
from gateway.store.deliveries import Ready, put
from gateway.store.engine import StoreEngine
from gateway.store.happenings import Cursor, read_happenings
from gateway.store.replays import add_replay, advance_replay, end_replay, read_replay, read_replays
from metaros.clock import Clock
from metaros.limits import Limits

__all__ = ["FAILED", "STOPPED", "Match", "PutAgain", "Replaying"]

log = logging.getLogger(__name__)

Match = Callable[[Happening], bool]
PutAgain = Callable[[Happening], Sequence[Put]]

FAILED, STOPPED = "replay_failed", "stopped"
PAGE = 50  # happenings of one transaction
AGAIN_S = 1.0


class Replaying:
    """The replays of this gateway; `noted` is told of what they put."""

    def __init__(
        self, database: Database, *, clock: Clock, limits: Limits, noted: Callable[[Sequence[Ready]], None]
    ) -> None:
        self._database = database
        self._clock = clock
        self._limits = limits
        self._noted = noted
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
        return await look(self._database, lambda engine: read_replays(engine, limit=2 * self._limits.replays_kept))

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
        """Put what is wanted of the next happenings; how many those were, 0 at the end."""

        def read(engine: StoreEngine) -> tuple[Cursor, list[tuple[Cursor, Happening]]] | None:
            found = read_replay(engine, replay.id)
            if found is None or found[0].ended_ns:
                return None
            return found[1], read_happenings(engine, replay.span, after=found[1], limit=PAGE)

        page = await look(self._database, read)
        if page is None:
            return 0
        _, rows = page
        if not rows:
            await self._end(replay, "")
            return 0
        puts = [one for _, happening in rows if match(happening) for one in _again(replay, happening, put_again)]
        if await self._database.run(functools.partial(self._put, replay, rows[-1][0], len(rows), puts)):
            self._noted([Ready(one.kind, one.target, one.due_ns) for one in puts])
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


def _again(replay: Replay, happening: Happening, put_again: PutAgain) -> list[Put]:
    key = f"replay/{replay.id}/{happening.source}/{happening.id}"
    return [replace(one, dedup=f"{key}/{number}") for number, one in enumerate(put_again(happening))]
