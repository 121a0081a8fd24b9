"""The gateway's master key: 32 bytes in a file that only the gateway's user reads; it seals the few secrets at rest
that the gateway needs again in full.

A sealed secret is nonce (12 bytes) and AES-256-GCM ciphertext. Its purpose and id are authenticated with it, so that
nobody who writes to the database can pass one secret off as another.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

from gateway.errors import DamagedError
from metaros.errors import ConfigError

__all__ = ["MASTER_KEY", "MasterKey"]

MASTER_KEY = "master.key"
KEY_BYTES = 32
NONCE_BYTES = 12


class MasterKey:
    """Seals and opens."""

    def __init__(self, key: bytes) -> None:
        from cryptography.hazmat.primitives.ciphers.aead import AESGCM

        if len(key) != KEY_BYTES:
            raise ConfigError(f"a master key has {KEY_BYTES} bytes")
        self._cipher = AESGCM(key)

    @classmethod
    def load_or_make(cls, data_dir: Path) -> MasterKey:
        """The key of a data directory, made at first use.

        Raises:
            ConfigError: the file is no key, cannot be read or made, or others than its owner can read it.
        """
        path = data_dir / MASTER_KEY
        try:
            if not path.exists():
                _make(path)
            if os.name == "posix" and path.stat().st_mode & 0o077:
                raise ConfigError(f"others can read {path}\nMake it the gateway's alone: chmod 600 {path}")
            key = path.read_bytes()
        except OSError as error:
            raise ConfigError(f"the master key {path} cannot be used: {error.strerror or error}") from error
        if len(key) != KEY_BYTES:
            raise ConfigError(f"{path} is no master key: it has {len(key)} bytes and not {KEY_BYTES}")
        return cls(key)

    def seal(self, purpose: str, secret_id: str, plain: bytes) -> bytes:
        """The secret for the database, different each time."""
        nonce = secrets.token_bytes(NONCE_BYTES)
        return nonce + self._cipher.encrypt(nonce, plain, _bound(purpose, secret_id))

    def open(self, purpose: str, secret_id: str, sealed: bytes) -> bytes:
        """The secret again; DamagedError when it was sealed by another key, as another secret, or has changed."""
        from cryptography.exceptions import InvalidTag

        try:
            bound = _bound(purpose, secret_id)
            return self._cipher.decrypt(sealed[:NONCE_BYTES], sealed[NONCE_BYTES:], bound)
        except (InvalidTag, ValueError) as error:
            raise DamagedError(
                f"the sealed secret of {purpose} {secret_id} cannot be opened: another master key sealed it, or it has"
                " changed"
            ) from error


def _bound(purpose: str, secret_id: str) -> bytes:
    return f"{purpose}|{secret_id}".encode()


def _make(path: Path) -> None:
    """Whole or not at all, and of two who make it at once both use the first one's."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(secrets.token_bytes(KEY_BYTES))
            file.flush()
            os.fsync(file.fileno())
        with contextlib.suppress(FileExistsError):
            os.link(draft, path)
    finally:
        draft.unlink(missing_ok=True)
