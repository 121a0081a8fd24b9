"""The interface of authenticators: whose key or session is this?"""

from __future__ import annotations

from typing import Protocol

from gateway.domain.principal import Principal

__all__ = ["Authenticator", "DenyAllAuthenticator"]


class Authenticator(Protocol):
    """Turns credentials into principals; never raises for a bad one, and takes as long for it as for a good one."""

    async def by_key(self, text: str) -> Principal | None:
        """The principal of an API key (`mrk_…`); None for one that is unknown, malformed, expired or revoked."""

    async def by_session(self, token: str) -> Principal | None:
        """The principal of a session cookie's value, with its `session_id` and `csrf`; None likewise."""


class DenyAllAuthenticator:
    """Accepts no credential: for a gateway without stored keys."""

    async def by_key(self, text: str) -> Principal | None:
        """Nobody's."""
        return None

    async def by_session(self, token: str) -> Principal | None:
        """Nobody's."""
        return None
