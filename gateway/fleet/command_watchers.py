"""Waits for commands to change: woken by changes of this gateway, and by one poll for those of others."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from contextlib import contextmanager

from gateway.errors import StoreError
from gateway.fleet.command_rows import CommandRows

__all__ = ["CommandWatchers", "WatchedCommand"]

log = logging.getLogger(__name__)

LOOK_S = 0.5  # another gateway, or a purge, may have changed what is waited for


class WatchedCommand:
    """One command that is waited for; `state` is the newest that a watcher has seen."""

    def __init__(self) -> None:
        self.state = ""
        self.count = 0
        self.event = asyncio.Event()  # of its next change; take it before looking at the command

    def saw(self, state: str) -> None:
        """A watcher has read this state: if it is another one, the others have not."""
        before, self.state = self.state, state
        if before not in ("", state):
            self.wake()

    def wake(self) -> None:
        """All who wait now."""
        event, self.event = self.event, asyncio.Event()
        event.set()


class CommandWatchers:
    """All methods on the event loop."""

    def __init__(self, rows: CommandRows) -> None:
        self._rows = rows
        self._watched: dict[str, WatchedCommand] = {}

    @contextmanager
    def watching(self, command_id: str) -> Iterator[WatchedCommand]:
        """While somebody waits for a command."""
        watched = self._watched.setdefault(command_id, WatchedCommand())
        watched.count += 1
        try:
            yield watched
        finally:
            watched.count -= 1
            if not watched.count:
                del self._watched[command_id]

    def changed(self, command_id: str) -> None:
        """It has another state."""
        if (watched := self._watched.get(command_id)) is not None:
            watched.wake()

    async def look(self) -> None:
        """One look at the store, for all that are waited for. Raises StoreError."""
        if not self._watched:
            return
        states = await self._rows.states(list(self._watched))
        for command_id, watched in list(self._watched.items()):
            if watched.state and states.get(command_id) != watched.state:
                watched.wake()

    async def run(self) -> None:
        """Look again and again, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                await self.look()
            except StoreError as error:
                log.debug("who waits for commands waits for the store: %s", error)
