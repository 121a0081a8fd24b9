"""The gateway's master key: 32 bytes in a file that only the gateway's user reads; it seals the few secrets at rest
that the gateway needs again in full.

A sealed secret is nonce (12 bytes) and AES-256-GCM ciphertext. Its purpose and id are authenticated with it, so that
nobody who writes to the database can pass one secret off as another.

While the key is replaced its successor lies beside it as `master.key.next`: then that one seals, and either opens. A
running gateway notices; see `gateway/identity/rekey.py`.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.errors import DamagedError
from metaros.errors import ConfigError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.ciphers.aead import AESGCM

__all__ = ["MASTER_KEY", "NEXT_KEY", "MasterKey", "make_key_file", "read_key_file"]

MASTER_KEY = "master.key"
NEXT_KEY = "master.key.next"
KEY_BYTES = 32
NONCE_BYTES = 12


class MasterKey:
    """Seals and opens; any thread's."""

    def __init__(self, key: bytes, *, folder: Path | None = None) -> None:
        """`folder` is where its file lies, to be looked at again whenever that has changed."""
        if len(key) != KEY_BYTES:
            raise ConfigError(f"a master key has {KEY_BYTES} bytes")
        self._ciphers = _ciphers(key)  # the first one seals
        self._folder = folder
        self._state = _state(folder)
        if folder is not None and self._state[1] is not None:
            self._read(folder)

    @classmethod
    def load_or_make(cls, data_dir: Path) -> MasterKey:
        """The key of a data directory, made at first use.

        Raises:
            ConfigError: the file is no key, cannot be read or made, or others than its owner can read it.
        """
        path = data_dir / MASTER_KEY
        try:
            if not path.exists():
                make_key_file(path)
        except OSError as error:
            raise ConfigError(f"the master key {path} cannot be made: {error.strerror or error}") from error
        return cls(read_key_file(path), folder=data_dir)

    def seal(self, purpose: str, secret_id: str, plain: bytes) -> bytes:
        """The secret for the database, different each time."""
        self._look()
        nonce = secrets.token_bytes(NONCE_BYTES)
        return nonce + self._ciphers[0].encrypt(nonce, plain, _bound(purpose, secret_id))

    def open(self, purpose: str, secret_id: str, sealed: bytes) -> bytes:
        """The secret again; DamagedError when it was sealed by another key, as another secret, or has changed."""
        from cryptography.exceptions import InvalidTag

        self._look()
        bound = _bound(purpose, secret_id)
        for cipher in self._ciphers:
            with contextlib.suppress(InvalidTag, ValueError):
                return cipher.decrypt(sealed[:NONCE_BYTES], sealed[NONCE_BYTES:], bound)
        raise DamagedError(
            f"the sealed secret of {purpose} {secret_id} cannot be opened: another master key sealed it, or it has"
            " changed"
        )

    def _look(self) -> None:
        """Take what lies in the folder now; a file that is gone, or no key, changes nothing."""
        if self._folder is None:
            return
        state = _state(self._folder)
        if state != self._state:
            self._state = state
            self._read(self._folder)

    def _read(self, folder: Path) -> None:
        keys = []
        for name in (NEXT_KEY, MASTER_KEY):
            with contextlib.suppress(ConfigError):
                keys.append(read_key_file(folder / name))
        if keys:
            self._ciphers = _ciphers(*keys)


def read_key_file(path: Path) -> bytes:
    """The key in a file; ConfigError when it is none, cannot be read, or others than its owner can read it."""
    try:
        if os.name == "posix" and path.stat().st_mode & 0o077:
            raise ConfigError(f"others can read {path}\nMake it the gateway's alone: chmod 600 {path}")
        key = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"the master key {path} cannot be used: {error.strerror or error}") from error
    if len(key) != KEY_BYTES:
        raise ConfigError(f"{path} is no master key: it has {len(key)} bytes and not {KEY_BYTES}")
    return key


def _ciphers(*keys: bytes) -> tuple[AESGCM, ...]:
    from cryptography.hazmat.primitives.ciphers.aead import AESGCM

    return tuple(AESGCM(key) for key in keys)


def _state(folder: Path | None) -> tuple[tuple[int, int] | None, ...]:
    """By what a change of the files is noticed."""
    found: list[tuple[int, int] | None] = []
    for name in (MASTER_KEY, NEXT_KEY):
        try:
            facts = (folder / name).stat() if folder is not None else None
        except OSError:
            facts = None
        found.append((facts.st_ino, facts.st_mtime_ns) if facts is not None else None)
    return tuple(found)


def _bound(purpose: str, secret_id: str) -> bytes:
    return f"{purpose}|{secret_id}".encode()


def make_key_file(path: Path) -> None:
    """Whole or not at all, and of two who make it at once both use the first one's; OSError."""
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
