"""The gateway's master key: 32 bytes in a file that only the gateway's user reads; it seals the few secrets at rest
that the gateway needs again in full.

A sealed secret is nonce (12 bytes) and AES-256-GCM ciphertext. Its purpose and id are authenticated with it, so that
nobody who writes to the database can pass one secret off as another.

Gateways of one store share it: each is given the same file by `--master-key` (METAROS_MASTER_KEY), or a copy in its
data directory.

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
from gateway.store.private_dir import others_can_read
from metaros.errors import ConfigError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.ciphers.aead import AESGCM

__all__ = ["MASTER_KEY", "NEXT_KEY", "MasterKey", "key_file", "make_key_file", "next_file", "read_key_file"]

MASTER_KEY = "master.key"
NEXT_KEY = "master.key.next"
ENVIRONMENT = "METAROS_MASTER_KEY"
KEY_BYTES = 32
NONCE_BYTES = 12


class MasterKey:
    """Seals and opens; any thread's."""

    def __init__(self, key: bytes, *, file: Path | None = None) -> None:
        """`file` is where it lies, to be looked at again whenever that has changed."""
        if len(key) != KEY_BYTES:
            raise ConfigError(f"a master key has {KEY_BYTES} bytes")
        self._keys: tuple[bytes, ...] = (key,)
        self._ciphers = _ciphers(key)  # the first one seals
        self._file = file
        self._state = _state(file)
        if file is not None and self._state[1] is not None:
            self._read(file)

    @classmethod
    def load_or_make(cls, data_dir: Path, file: Path | None = None) -> MasterKey:
        """The key in `file`, else in the one that the environment names or the data directory has, made at first use.

        Raises:
            ConfigError: the file is no key, cannot be read or made, or others than its owner can read it.
        """
        path = file or key_file(data_dir)
        try:
            if not path.exists():
                make_key_file(path)
        except OSError as error:
            raise ConfigError(f"the master key {path} cannot be made: {error.strerror or error}") from error
        return cls(read_key_file(path), file=path)

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

    def subkeys(self, purpose: str) -> tuple[bytes, ...]:
        """A key of 32 bytes for another purpose than sealing secrets: of this key, then of its successor if it has one.

        Nobody who has one of them comes by the master key, or by the key of another purpose.
        """
        self._look()
        return tuple(_derived(key, purpose) for key in reversed(self._keys))

    def _look(self) -> None:
        """Take what lies there now; a file that is gone, or no key, changes nothing."""
        if self._file is None:
            return
        state = _state(self._file)
        if state != self._state:
            self._state = state
            self._read(self._file)

    def _read(self, file: Path) -> None:
        keys = []
        for path in (next_file(file), file):
            with contextlib.suppress(ConfigError):
                keys.append(read_key_file(path))
        if keys:
            self._keys, self._ciphers = tuple(keys), _ciphers(*keys)


def key_file(data_dir: Path) -> Path:
    """Where the master key of a data directory is: METAROS_MASTER_KEY names another file for it."""
    return Path(os.environ.get(ENVIRONMENT) or data_dir / MASTER_KEY)


def next_file(file: Path) -> Path:
    """Where its successor lies while it is replaced."""
    return file.with_name(file.name + ".next")


def read_key_file(path: Path) -> bytes:
    """The key in a file; ConfigError when it is none, cannot be read, or others than its owner can read it."""
    try:
        if others_can_read(path):
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


def _derived(key: bytes, purpose: str) -> bytes:
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.kdf.hkdf import HKDF

    return HKDF(algorithm=SHA256(), length=KEY_BYTES, salt=None, info=f"metaros|{purpose}".encode()).derive(key)


def _state(file: Path | None) -> tuple[tuple[int, int] | None, ...]:
    """By what a change of the files is noticed."""
    if file is None:
        return (None, None)
    found: list[tuple[int, int] | None] = []
    for path in (file, next_file(file)):
        try:
            facts = path.stat()
        except OSError:
            found.append(None)
        else:
            found.append((facts.st_ino, facts.st_mtime_ns))
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
