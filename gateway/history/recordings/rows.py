"""The recordings' rows as the feature uses them: short calls, each one transaction of the store."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Protocol, TypeVar

from gateway.domain.fleet.recording import FAILED, STORED, UNFINISHED, Recording
from gateway.errors import StoreError
from gateway.store.engine import StoreEngine
from gateway.store.fleet import recordings as table
from metaros.clock import Clock

__all__ = ["Database", "Rows"]

Result = TypeVar("Result")


class Database(Protocol):
    """What is needed of the store."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""


class Rows:
    """Every method raises StoreError when the database cannot do it now."""

    def __init__(self, database: Database, *, clock: Clock) -> None:
        """`ended` hears of every recording that comes to its end here."""
        self._database = database
        self.ended: Callable[[Recording], None] | None = None
        self._clock = clock

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """More than one thing in one write transaction."""
        return await self._database.run(job)

    async def add(self, recording: Recording, *, unfinished: int) -> None:
        """A new request; UnknownRobotError, or TooManyError when the robot has `unfinished` already."""
        await self.run(lambda engine: table.add_recording(engine, recording, unfinished=unfinished))

    async def get(self, recording_id: str) -> Recording | None:
        """One recording."""
        return await self._read(lambda engine: table.get_recording(engine, recording_id))

    async def newest(self, *, robot_id: str | None, limit: int, before: str | None) -> list[Recording]:
        """The newest, newest first."""
        return await self._read(
            lambda engine: table.list_recordings(engine, robot_id=robot_id, limit=limit, before=before)
        )

    async def unfinished(self, robot_id: str | None = None) -> list[Recording]:
        """Those not at their end, oldest first; of one robot, or of all."""
        robots = None if robot_id is None else [robot_id]
        return await self._read(lambda engine: table.unfinished_recordings(engine, robots=robots))

    async def change(self, recording_id: str, *, within: Sequence[str] = UNFINISHED, **values: Any) -> bool:
        """Set columns, and that it lives; False when its state is none of `within`, or it is gone."""
        live = {"live_ns": self._clock.wall_ns(), **values}
        done = await self.run(lambda engine: table.change_recording(engine, recording_id, within=within, **live))
        if done and self.ended is not None and values.get("state") in (STORED, FAILED):
            with suppress(StoreError):  # its end is stored; that nobody hears of it now is the lesser evil
                if (recording := await self.get(recording_id)) is not None:
                    self.ended(recording)
        return done

    async def _read(self, job: Callable[[StoreEngine], Result]) -> Result:
        def read(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._database.read(read)
