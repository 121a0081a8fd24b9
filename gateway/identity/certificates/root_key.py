"""The root's private key as a file of the data directory: which one belongs to a root, and how one follows another.

During a change of the root its successor lies beside it, from before the store knows of the new root until it has
taken the old one's place: whatever stops the program, the key of the newest root is in one of the two files.
"""

from __future__ import annotations

import os
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from gateway.errors import AuthorityError

__all__ = [
    "ROOT_KEY",
    "ROOT_KEY_NEXT",
    "has_root_key",
    "read_root_key",
    "settle_root_key",
    "sync_folder",
    "write_secret",
]

ROOT_KEY = "ca-root.key"
ROOT_KEY_NEXT = "ca-root.key.next"


def has_root_key(folder: Path, root: x509.Certificate) -> bool:
    """Whether the key of this very root is here."""
    return _found(folder, root) is not None


def read_root_key(folder: Path, root: x509.Certificate) -> ec.EllipticCurvePrivateKey:
    """The key of this very root; AuthorityError when it is not here."""
    found = _found(folder, root)
    if found is None:
        raise AuthorityError(f"the root's key {folder / ROOT_KEY} is not here, cannot be read, or is another root's")
    return found[1]


def settle_root_key(folder: Path, root: x509.Certificate) -> None:
    """Let the newest root's key take its place, and the one before it go; nothing where it has."""
    found = _found(folder, root)
    if found is not None and found[0].name == ROOT_KEY_NEXT:
        found[0].replace(folder / ROOT_KEY)
        sync_folder(folder)


def write_secret(path: Path, data: bytes) -> None:
    """Write a file that nobody else can read, whole or not at all; on the disk before this returns."""
    partial = path.with_name(path.name + ".partial")
    partial.unlink(missing_ok=True)
    with os.fdopen(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Let renames in it outlast a loss of power."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _found(folder: Path, root: x509.Certificate) -> tuple[Path, ec.EllipticCurvePrivateKey] | None:
    for path in (folder / ROOT_KEY, folder / ROOT_KEY_NEXT):
        try:
            key = serialization.load_pem_private_key(path.read_bytes(), password=None)
        except (OSError, ValueError, TypeError):
            continue
        if isinstance(key, ec.EllipticCurvePrivateKey) and key.public_key() == root.public_key():
            return path, key
    return None
