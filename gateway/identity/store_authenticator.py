"""Authenticates keys and sessions of the database, with a short-lived cache.

A principal that was found good is not looked up again for `REMEMBERED_S`; so what is revoked through another gateway,
or beside this one on its data directory, ends within that time, and through this gateway at once. Whoever asks shortly
before that time is over is looked up behind the answer: so nobody who asks all the time waits for the store.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import TypeVar

from gateway.domain.principal import Principal
from gateway.errors import StoreError
from gateway.identity import sessions
from gateway.identity.keys import key_principal, parse_key
from gateway.identity.secret_text import same_secret, secret_hash
from gateway.store import Store
from gateway.store.accounts.api_keys import key_and_owner, touch_key
from gateway.store.accounts.sessions import find_session, touch_session
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["REMEMBERED_S", "StoreAuthenticator"]

Result = TypeVar("Result")
REMEMBERED_S = 2.0
AHEAD_S = 0.5  # of that, in which somebody who asks is looked up anew
USED_S = 300.0  # how exactly it is kept when a key or session was used last
SECOND_NS = 10**9


class StoreAuthenticator:
    """An `Authenticator` on the store. Remembers hashes of credentials only, and no bad ones."""

    def __init__(self, store: Store, *, clock: Clock) -> None:
        self._store = store
        self._clock = clock
        self._known: dict[str, tuple[Principal, float]] = {}
        self._ahead: dict[str, asyncio.Task[None]] = {}  # who is being looked up behind an answer
        self._changes = 0  # how often everybody was forgotten

    async def by_key(self, text: str) -> Principal | None:
        """The principal of an API key; None for one that is unknown, malformed, expired or revoked."""
        digest = secret_hash(text)
        return self._remembered(digest, lambda: self._by_key(text, digest)) or await self._by_key(text, digest)

    async def _by_key(self, text: str, digest: str) -> Principal | None:
        changes = self._changes
        key_id, secret = parse_key(text) or ("", "")
        found = await self._read(lambda engine: key_and_owner(engine, key_id))
        good = same_secret(found[0].secret_hash if found is not None else "", secret)
        if found is None or not good:
            return None
        now_ns = self._clock.wall_ns()
        principal = key_principal(*found, now_ns=now_ns)
        if principal is not None:
            self._remember(digest, principal, changes)
            if now_ns - found[0].used_ns >= USED_S * SECOND_NS:
                await self._note(lambda engine: touch_key(engine, key_id, now_ns=now_ns))
        return principal

    async def by_session(self, token: str) -> Principal | None:
        """The principal of a session's token, with its id and CSRF token; None for one that is not or no more."""
        digest = secret_hash(token)
        return self._remembered(digest, lambda: self._by_session(token, digest)) or await self._by_session(
            token, digest
        )

    async def _by_session(self, token: str, digest: str) -> Principal | None:
        changes = self._changes
        found = await self._read(lambda engine: find_session(engine, digest))
        now_ns = self._clock.wall_ns()
        if found is None or not sessions.live(*found, now_ns=now_ns):
            return None
        principal = sessions.session_principal(*found, token)
        self._remember(digest, principal, changes)
        if now_ns - found[0].seen_ns >= USED_S * SECOND_NS:
            await self._note(lambda engine: touch_session(engine, digest, now_ns=now_ns))
        return principal

    def forget(self) -> None:
        """Look everybody up again: somebody's rights have changed."""
        self._known.clear()
        self._changes += 1

    def _remembered(self, digest: str, look_up: Callable[[], Awaitable[Principal | None]]) -> Principal | None:
        principal, until_s = self._known.get(digest, (None, 0.0))
        left_s = until_s - self._clock.monotonic_s()
        if left_s <= 0.0:
            return None
        if left_s <= AHEAD_S and digest not in self._ahead:
            self._ahead[digest] = asyncio.get_running_loop().create_task(self._look_ahead(digest, look_up))
        return principal

    async def _look_ahead(self, digest: str, look_up: Callable[[], Awaitable[Principal | None]]) -> None:
        """Remember a principal for longer, or forget it now."""
        try:
            if await look_up() is None:
                self._known.pop(digest, None)
        except StoreError:  # whoever asks when the time is over is told
            pass
        finally:
            del self._ahead[digest]

    def _remember(self, digest: str, principal: Principal, changes: int) -> None:
        """For what was found before somebody's rights changed, `changes` is another one: it is not kept."""
        if changes != self._changes:
            return
        self._known.pop(digest, None)
        while len(self._known) >= LIMITS.principals_remembered:
            self._known.pop(next(iter(self._known)))
        self._known[digest] = (principal, self._clock.monotonic_s() + REMEMBERED_S)

    async def _note(self, job: Callable[[StoreEngine], object]) -> None:
        """Write when it was used, where that is possible: a full disk locks nobody out."""
        with contextlib.suppress(StoreError):
            await self._store.run(job)

    async def _read(self, job: Callable[[StoreEngine], Result]) -> Result:
        def read(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._store.read(read)
