"""The keys of sealing: one that seals, and those before it, which still open what they sealed.

A text file of mode 0600, the same on the robot and where payloads are opened; the gateway never has it. A key of the
file seals nothing itself: each process makes data keys of it, see `metaros/seal/envelope.py`.
"""

from __future__ import annotations

import base64
import binascii
import json
import os
import stat
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from metaros.clock import Clock
from metaros.errors import KeyringError
from metaros.limits import LIMITS

__all__ = ["Keyring", "SealKey"]

ID_BYTES: Final = 8
SECRET_BYTES: Final = 32
_MAX_BYTES: Final = 64 * 1024
Entropy = Callable[[int], bytes]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SealKey:
    """One key; its secret is in no representation of it."""

    key_id: bytes
    secret: bytes
    created_ns: int

    @classmethod
    def make(cls, clock: Clock, entropy: Entropy = os.urandom) -> SealKey:
        """A new random one."""
        return cls(key_id=entropy(ID_BYTES), secret=entropy(SECRET_BYTES), created_ns=clock.wall_ns())

    def __repr__(self) -> str:
        return f"SealKey({self.key_id.hex()})"


@dataclass(frozen=True, slots=True)
class Keyring:
    """Oldest first; the last one seals."""

    keys: tuple[SealKey, ...]

    @property
    def current(self) -> SealKey:
        """The one that seals."""
        return self.keys[-1]

    def find(self, key_id: bytes) -> SealKey | None:
        """The key of that id."""
        return next((key for key in self.keys if key.key_id == key_id), None)

    def rotated(self, key: SealKey, *, keep: int = LIMITS.seal_keys_kept) -> Keyring:
        """With `key` as the one that seals, and at most `keep` before it; what older ones sealed no longer opens."""
        return Keyring((*self.keys[max(0, len(self.keys) - keep) :], key) if keep else (key,))

    @classmethod
    def load(cls, path: Path) -> Keyring:
        """Read a file; KeyringError when it is missing, readable for others, or damaged."""
        try:
            with path.open("rb") as file:
                mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
                data = file.read(_MAX_BYTES + 1)
        except OSError as error:
            raise KeyringError(f"{path}: {error.strerror}; make one with: metaros seal key new {path}") from error
        if sys.platform != "win32" and mode & 0o077:
            raise KeyringError(f"{path} can be read by others (mode {mode:o}): chmod 600 {path}")
        try:
            keys = tuple(_parsed(facts) for facts in json.loads(data)["keys"])
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            raise KeyringError(f"{path} is no keyring, or damaged") from error
        if not keys or len({key.key_id for key in keys}) < len(keys) or len(keys) > LIMITS.seal_keys_kept + 1:
            raise KeyringError(f"{path}: no key, a key twice, or more than {LIMITS.seal_keys_kept + 1}")
        return cls(keys)

    def save(self, path: Path, *, new: bool = False) -> None:
        """Write the file whole, mode 0600; with `new` one that is there is not replaced. Raises KeyringError."""
        facts = {"version": 1, "keys": [_facts(key) for key in self.keys]}
        draft = path.with_name(f"{path.name}.{os.getpid()}.partial")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.write(json.dumps(facts, indent=1) + "\n")
                file.flush()
                os.fsync(file.fileno())
            if new:
                os.link(draft, path)
            else:
                draft.replace(path)
        except FileExistsError as error:
            raise KeyringError(f"{error.filename2 or path} is there already, and is not overwritten") from error
        except OSError as error:
            raise KeyringError(f"{path}: {error.strerror}") from error
        finally:
            draft.unlink(missing_ok=True)


def _facts(key: SealKey) -> dict[str, Any]:
    secret = base64.b64encode(key.secret).decode()
    return {"id": key.key_id.hex(), "secret": secret, "created_ns": key.created_ns}


def _parsed(facts: dict[str, Any]) -> SealKey:
    try:
        secret = base64.b64decode(facts["secret"], validate=True)
    except binascii.Error as error:
        raise ValueError("secret") from error
    key = SealKey(key_id=bytes.fromhex(facts["id"]), secret=secret, created_ns=int(facts["created_ns"]))
    if len(key.key_id) != ID_BYTES or len(key.secret) != SECRET_BYTES:
        raise ValueError("length")
    return key
