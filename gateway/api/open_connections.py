"""Open sockets and downloads by credential: each credential is checked again every two seconds, and counted.

A request is authenticated when it comes; a socket and a long download live on. So each credential with open ones is
looked up again, once for all of them, and they are ended when it was revoked, expired, or means another role or other
robots by now. Polling works where a notification would not: another gateway on the same store may have revoked it.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from starlette.requests import HTTPConnection

from gateway.api.authorization import CREDENTIAL_KEY, principal_of
from gateway.api.middleware.authenticate import Credential, identify
from gateway.domain.principal import Principal
from gateway.errors import CredentialsError
from gateway.identity.authenticator import Authenticator
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["REVOKED", "TOO_MANY", "OpenConnection", "OpenConnections"]

REVOKED = 4401  # the close code of a socket whose credential is not good any more
TOO_MANY = 4429  # and of one over the limit of viewers

log = logging.getLogger(__name__)


@dataclass(eq=False, slots=True)
class OpenConnection:
    """One open socket; `revoked` is set when it has to end."""

    principal: Principal
    revoked: asyncio.Event = field(default_factory=asyncio.Event)


class OpenConnections:
    """Of one gateway. Lives on the event loop."""

    def __init__(self, authenticator: Authenticator, *, limits: Limits = LIMITS) -> None:
        self._authenticator = authenticator
        self._limits = limits
        self._by_credential: dict[Credential, set[OpenConnection]] = {}
        self._viewers: Counter[tuple[str, str]] = Counter()  # by kind and id of who they are

    def viewers_full(self, principal: Principal) -> bool:
        """Whether the limit of viewers of live data is reached, in all or for that user or key."""
        limits, mine = self._limits, self._viewers[principal.kind, principal.id]
        return self._viewers.total() >= limits.viewers or mine >= limits.viewers_each

    @contextmanager
    def count_viewer(self, principal: Principal) -> Iterator[None]:
        """Count a viewer of live data while it is connected; ask `viewers_full` just before."""
        who = (principal.kind, principal.id)
        self._viewers[who] += 1
        try:
            yield
        finally:
            self._viewers[who] -= 1
            if not self._viewers[who]:
                del self._viewers[who]

    @contextmanager
    def track(self, connection: HTTPConnection) -> Iterator[OpenConnection]:
        """A socket is open. An anonymous one has no credential that could be revoked."""
        opened = OpenConnection(principal_of(connection))
        credential: Credential | None = connection.scope.get(CREDENTIAL_KEY)
        if credential is None:
            yield opened
            return
        self._by_credential.setdefault(credential, set()).add(opened)
        try:
            yield opened
        finally:
            left = self._by_credential.get(credential, set())
            left.discard(opened)
            if not left:
                self._by_credential.pop(credential, None)

    async def while_allowed(self, connection: HTTPConnection, pieces: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
        """The pieces of a long response; CredentialsError once its credential is revoked."""
        with self.track(connection) as opened:
            async for piece in pieces:
                if opened.revoked.is_set():
                    raise CredentialsError("who asked may not have it any more")
                yield piece

    async def run(self) -> None:
        """Check periodically, until cancelled."""
        while True:
            await asyncio.sleep(LIMITS.credential_check_s)
            await self.check()

    async def check(self) -> None:
        """Check every credential with open sockets once. While the store cannot answer, they stay."""
        for credential in list(self._by_credential):
            try:
                found = await identify(self._authenticator, credential)
            except MetarosError as error:
                log.warning("who is connected cannot be checked now: %s", error)
                return
            for opened in self._by_credential.get(credential, ()):
                if found is None or _rights(found) != _rights(opened.principal):
                    opened.revoked.set()


def _rights(principal: Principal) -> tuple[object, ...]:
    return principal.id, principal.role, principal.robots, principal.scopes
