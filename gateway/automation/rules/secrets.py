"""Secrets of hooks and of webhooks' targets: made here, shown once, kept sealed by the master key."""

from __future__ import annotations

import base64
import secrets
from collections.abc import Callable

from gateway.automation.rules.registry import Database
from gateway.domain.automation.rule import SECRET
from gateway.store.automation.hooks import keep_secret, read_secret
from gateway.store.engine import StoreEngine
from metaros.clock import Clock

__all__ = ["Seal", "Secrets", "Unseal", "hook_owner", "new_secret", "target_owner"]

SECRET_BYTES = 32
Seal = Callable[[str, str, bytes], bytes]  # purpose, id, plain
Unseal = Callable[[str, str, bytes], bytes]


def hook_owner(name: str) -> str:
    """Under which a hook's secret is kept."""
    return f"hook/{name}"


def target_owner(rule: str, target: str) -> str:
    """Under which the secret of a rule's target is kept."""
    return f"target/{rule}/{target}"


def new_secret() -> str:
    """As Standard Webhooks writes them."""
    return "whsec_" + base64.b64encode(secrets.token_bytes(SECRET_BYTES)).decode()


class Secrets:
    """Keeps and finds them."""

    def __init__(self, database: Database, *, seal: Seal, unseal: Unseal, clock: Clock) -> None:
        self._database = database
        self._seal = seal
        self._unseal = unseal
        self._clock = clock

    def keep_within(self, engine: StoreEngine, owner: str, secret: str) -> None:
        """Keep a secret within a transaction of the caller's."""
        sealed = self._seal(SECRET, owner, secret.encode())
        keep_secret(engine, owner, sealed, now_ns=self._clock.wall_ns())

    async def make(self, owner: str) -> str:
        """A new secret in place of the one before, if any."""
        secret = new_secret()
        await self._database.run(lambda engine: self.keep_within(engine, owner, secret))
        return secret

    async def find(self, owner: str) -> str:
        """The owner's secret; "" where it has none. Raises StoreError, DamagedError."""

        def job(engine: StoreEngine) -> bytes | None:
            with engine.transaction(write=False):
                return read_secret(engine, owner)

        sealed = await self._database.read(job)
        return self._unseal(SECRET, owner, sealed).decode() if sealed is not None else ""
