"""Who is connected by an open socket, asked again every two seconds: whoever may not be here any more is shown out.

A request is checked when it comes; a socket, and a long download, live on. So each credential with open ones is looked
up again, once for all of them, and they are ended when it was revoked, expired, or means another role or other robots
by now. Asking works where telling would not: another gateway on the same store may have revoked it.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from starlette.requests import HTTPConnection

from gateway.api.allow import CREDENTIAL_KEY, principal_of
from gateway.api.authenticate import Credential, identify
from gateway.domain.principal import Principal
from gateway.errors import CredentialsError
from gateway.identity.door import Door
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["REVOKED", "TOO_MANY", "Attendance", "Visit"]

REVOKED = 4401  # the close code of a socket whose credential is not good any more
TOO_MANY = 4429  # and of one for which there is no place

log = logging.getLogger(__name__)


@dataclass(eq=False, slots=True)
class Visit:
    """One open socket; `over` is set when it has to end."""

    principal: Principal
    over: asyncio.Event = field(default_factory=asyncio.Event)


class Attendance:
    """Lives on the event loop."""

    def __init__(self, door: Door, *, limits: Limits = LIMITS) -> None:
        self._door = door
        self._limits = limits
        self._visits: dict[Credential, set[Visit]] = {}
        self._viewers: Counter[tuple[str, str]] = Counter()  # by kind and id of who they are

    def full(self, principal: Principal) -> bool:
        """Whether there is no place for one more viewer of live data, or none for one more of that user or key."""
        limits, mine = self._limits, self._viewers[principal.kind, principal.id]
        return self._viewers.total() >= limits.viewers or mine >= limits.viewers_each

    @contextmanager
    def place(self, principal: Principal) -> Iterator[None]:
        """A viewer of live data takes a place; ask `full` just before."""
        who = (principal.kind, principal.id)
        self._viewers[who] += 1
        try:
            yield
        finally:
            self._viewers[who] -= 1
            if not self._viewers[who]:
                del self._viewers[who]

    @contextmanager
    def visit(self, connection: HTTPConnection) -> Iterator[Visit]:
        """A socket is open. Nobody's credential cannot be revoked: that visit is never over."""
        visit = Visit(principal_of(connection))
        credential: Credential | None = connection.scope.get(CREDENTIAL_KEY)
        if credential is None:
            yield visit
            return
        self._visits.setdefault(credential, set()).add(visit)
        try:
            yield visit
        finally:
            left = self._visits.get(credential, set())
            left.discard(visit)
            if not left:
                self._visits.pop(credential, None)

    async def pieces(self, connection: HTTPConnection, pieces: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
        """A long answer's pieces, until its asker may not be here any more: then CredentialsError."""
        with self.visit(connection) as visit:
            async for piece in pieces:
                if visit.over.is_set():
                    raise CredentialsError("who asked may not have it any more")
                yield piece

    async def run(self) -> None:
        """Ask for ever."""
        while True:
            await asyncio.sleep(LIMITS.attendance_s)
            await self.check()

    async def check(self) -> None:
        """Ask once about every credential with open sockets. While the store cannot answer, they stay."""
        for credential in list(self._visits):
            try:
                found = await identify(self._door, credential)
            except MetarosError as error:
                log.warning("who is connected cannot be checked now: %s", error)
                return
            for visit in self._visits.get(credential, ()):
                if found is None or _rights(found) != _rights(visit.principal):
                    visit.over.set()


def _rights(principal: Principal) -> tuple[object, ...]:
    return principal.id, principal.role, principal.robots, principal.scopes
