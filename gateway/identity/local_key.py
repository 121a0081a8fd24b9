"""The local admin key, for whoever can read the data directory: made at every start, gone with the process.

Such a user could as well change the database. So there is a key, in a file that only this user reads, with which the
command line, `metaros up` and the first administrator begin; nothing of it stays behind when the gateway ends.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import os
import secrets
from pathlib import Path

from gateway.domain.principal import EVERY_ROBOT, Principal, Role
from gateway.identity.authenticator import Authenticator

__all__ = ["LOCAL_KEY_FILE", "AuthenticatorChain", "LocalKey"]

LOCAL_KEY_FILE = "local.key"
_PREFIX = "mrk_local_"


class LocalKey:
    """An authenticator of one key, of role admin."""

    def __init__(self, data_dir: Path) -> None:
        self._path = data_dir / LOCAL_KEY_FILE
        self._hash = b""

    def write(self) -> None:
        """Make a new key and put it into the file, which appears whole and readable by this user only."""
        key = _PREFIX + secrets.token_urlsafe(32)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        partial = self._path.with_name(f"{self._path.name}.{secrets.token_hex(8)}")
        with os.fdopen(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(key + "\n")
        partial.replace(self._path)
        self._hash = _hashed(key)

    def remove(self) -> None:
        """End the key, and delete its file unless another gateway's is there by now."""
        mine, self._hash = self._hash, b""
        with contextlib.suppress(OSError, UnicodeDecodeError):
            if mine and hmac.compare_digest(_hashed(self._path.read_text().strip()), mine):
                self._path.unlink()

    async def by_key(self, text: str) -> Principal | None:
        """The local user, or None."""
        if not self._hash or not hmac.compare_digest(_hashed(text), self._hash):
            return None
        return Principal(kind="key", id="local", name="local", role=Role.ADMIN, robots=EVERY_ROBOT)

    async def by_session(self, token: str) -> Principal | None:
        """It has none."""
        return None


class AuthenticatorChain:
    """Several authenticators as one: the first that knows a credential answers."""

    def __init__(self, *authenticators: Authenticator) -> None:
        self._authenticators = authenticators

    async def by_key(self, text: str) -> Principal | None:
        """The principal of an API key."""
        for authenticator in self._authenticators:
            if (found := await authenticator.by_key(text)) is not None:
                return found
        return None

    async def by_session(self, token: str) -> Principal | None:
        """The principal of a session."""
        for authenticator in self._authenticators:
            if (found := await authenticator.by_session(token)) is not None:
                return found
        return None


def _hashed(key: str) -> bytes:
    return hashlib.sha256(key.encode("utf-8", "surrogatepass")).digest()
