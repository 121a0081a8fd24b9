"""An authenticator with keys and sessions in memory, which a test creates and revokes as it likes."""

from __future__ import annotations

import secrets

from gateway.domain.principal import EVERY_ROBOT, Principal, Role

__all__ = ["KeyRing", "bearer"]


class KeyRing:
    """Real credentials of the real form; only that nothing is stored."""

    def __init__(self) -> None:
        self._keys: dict[str, Principal] = {}
        self._sessions: dict[str, Principal] = {}

    def add(self, *, role: Role, robots: tuple[str, ...] = EVERY_ROBOT, name: str = "test") -> str:
        """A new key, as text."""
        number = secrets.token_hex(8)
        text = f"mrk_{number}_{secrets.token_urlsafe(32)}"
        self._keys[text] = Principal(kind="key", id=number, name=name, role=role, robots=robots)
        return text

    def sign_in(self, *, role: Role, robots: tuple[str, ...] = EVERY_ROBOT, name: str = "test") -> tuple[str, str]:
        """A new session: the cookie's value and its CSRF token."""
        token, csrf = secrets.token_urlsafe(32), secrets.token_urlsafe(16)
        self._sessions[token] = Principal(
            kind="user", id=name, name=name, role=role, robots=robots, session_id=secrets.token_hex(8), csrf=csrf
        )
        return token, csrf

    def put(self, key: str, principal: Principal) -> None:
        """Let a key mean somebody else from now on."""
        self._keys[key] = principal

    def revoke(self, text: str) -> None:
        """End a key or a session."""
        self._keys.pop(text, None)
        self._sessions.pop(text, None)

    async def by_key(self, text: str) -> Principal | None:
        """Whose key it is."""
        return self._keys.get(text)

    async def by_session(self, token: str) -> Principal | None:
        """Whose session it is."""
        return self._sessions.get(token)


def bearer(key: str) -> dict[str, str]:
    """The header of a key; none for no key."""
    return {"Authorization": f"Bearer {key}"} if key else {}
