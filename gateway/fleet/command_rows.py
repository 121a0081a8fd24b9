"""The commands' rows as the feature uses them: short calls, each one transaction of the store."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Protocol, TypeVar

from gateway.domain.fleet.command import OPEN, Command
from gateway.errors import StoreError, UnknownRobotError
from gateway.store.engine import StoreEngine
from gateway.store.fleet import commands as table

__all__ = ["CommandRows", "Database"]

Result = TypeVar("Result")


class Database(Protocol):
    """What is needed of the store."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""


class CommandRows:
    """Every method raises StoreError when the database cannot do it now."""

    def __init__(self, database: Database, *, ended: Callable[[Command], None] | None = None) -> None:
        """`ended` hears of every command that comes to its end here."""
        self._database = database
        self._ended = ended

    async def add(self, command: Command, *, most_open: int) -> Command:
        """A new one, or what was stored under its idempotency key before; see store/commands.py for the errors."""
        return await self._database.run(lambda engine: table.add_command(engine, command, most_open=most_open))

    async def note(self, commands: Sequence[Command]) -> None:
        """Commands that are over already."""

        def job(engine: StoreEngine) -> None:
            for command in commands:
                with suppress(UnknownRobotError):  # it is not stored yet, or not any more
                    table.add_command(engine, command, most_open=0)

        await self._database.run(job)
        if self._ended is not None:
            for command in commands:
                self._ended(command)

    async def same(self, command: Command) -> Command | None:
        """The command under its issuer's idempotency key; IdempotencyConflictError where it is another request."""
        return await self._read(lambda engine: table.same_command(engine, command))

    async def get(self, command_id: str) -> Command | None:
        """One command."""
        return await self._read(lambda engine: table.get_command(engine, command_id))

    async def states(self, command_ids: Sequence[str]) -> dict[str, str]:
        """The states of these commands; without those that are gone."""
        return await self._read(lambda engine: table.command_states(engine, command_ids))

    async def newest(self, **filters: Any) -> list[Command]:
        """The newest, newest first."""
        return await self._read(lambda engine: table.list_commands(engine, **filters))

    async def waiting_robots(self) -> list[str]:
        """The robots that have durable commands which are not over."""
        return await self._read(table.waiting_robots)

    async def open(self, robot: str, *, limit: int) -> list[Command]:
        """A robot's durable commands that are not over, oldest first."""
        return await self._read(lambda engine: table.open_commands(engine, robot, limit=limit))

    async def overdue(self, **times: int) -> list[Command]:
        """What is to be ended by time."""
        return await self._read(lambda engine: table.overdue_commands(engine, **times))

    async def change(self, command_id: str, *, within: Sequence[str] = OPEN, **values: Any) -> bool:
        """Set columns; False when its state is none of `within`, or it is gone."""
        done = await self._database.run(
            lambda engine: table.change_command(engine, command_id, within=within, **values)
        )
        if done and self._ended is not None and "ended_ns" in values:
            with suppress(StoreError):  # its end is stored; that nobody hears of it now is the lesser evil
                if (command := await self.get(command_id)) is not None:
                    self._ended(command)
        return done

    async def purge(self, *, before_ns: int, most: int) -> int:
        """Delete what ended long ago; how many went."""
        return await self._database.run(lambda engine: table.purge_commands(engine, before_ns=before_ns, most=most))

    async def _read(self, job: Callable[[StoreEngine], Result]) -> Result:
        def read(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._database.read(read)
