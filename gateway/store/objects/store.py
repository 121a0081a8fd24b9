"""The interface of object stores: bytes under a name, whole or not at all.

A name never gets other bytes later: whoever writes again takes a new name. The methods block, and are used on threads.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Protocol

from gateway.errors import CorruptObjectError
from metaros.errors import ConfigError

__all__ = ["PIECE_BYTES", "ObjectInfo", "ObjectStore", "Source", "check_name", "chunks", "opened", "pieces"]

PIECE_BYTES = 4 << 20  # what is held in memory of an object that is read through
NAME = re.compile(r"(?!.*\.\.)[a-z0-9_-][a-z0-9_.-]*(/[a-z0-9_-][a-z0-9_.-]*)*")
NAME_CHARS = 255

Source = Path | BinaryIO


@dataclass(frozen=True, slots=True)
class ObjectInfo:
    """One object as the store lists it."""

    name: str
    size_bytes: int
    modified_ns: int


class ObjectStore(Protocol):
    """A directory or a bucket. Every method may raise ObjectStoreError: it may work later."""

    @property
    def where(self) -> str:
        """What people call it; without secrets."""

    def put(self, name: str, source: Source, *, size_bytes: int, sha256: str) -> None:
        """Keep the rest of `source` under `name`; when it returns, all of it is durable.

        Raises:
            CorruptObjectError: `source` does not hold those bytes (`sha256` in hexadecimal); nothing was kept.
        """

    def read(self, name: str, *, start: int = 0, size_bytes: int | None = None) -> bytes:
        """That range of an object, or what there is of it.

        Raises:
            ObjectMissingError: there is none of that name.
        """

    def names(self, prefix: str = "") -> Iterator[ObjectInfo]:
        """Every object whose name begins with `prefix`, in the store's own order, fetched little by little."""

    def delete(self, name: str) -> None:
        """The object is gone, whether it was there or not."""

    def sweep(self, *, before_ns: int) -> int:
        """Delete what is left of puts that began before that wall time and never ended; how many."""

    def close(self) -> None:
        """Let connections go."""


def chunks(
    objects: ObjectStore, name: str, *, start: int = 0, size_bytes: int | None = None, piece_bytes: int = PIECE_BYTES
) -> Iterator[bytes]:
    """A range of an object in pieces, to its end unless `size_bytes` says less; a short object ends it early."""
    left = size_bytes
    while left is None or left > 0:
        asked = piece_bytes if left is None else min(piece_bytes, left)
        piece = objects.read(name, start=start, size_bytes=asked)
        if piece:
            yield piece
        if len(piece) < asked:
            return
        start += asked
        left = None if left is None else left - asked


def check_name(name: str) -> str:
    """The name, when it is one in every kind of store.

    Raises:
        ConfigError: it is not; a mistake of ours.
    """
    if len(name) > NAME_CHARS or NAME.fullmatch(name) is None:
        raise ConfigError(f"{name!r} is no name of an object: a-z, 0-9, '_', '-', '.' and '/', at most {NAME_CHARS}")
    return name


def opened(source: Source) -> AbstractContextManager[BinaryIO]:
    """The bytes of a path, closed afterwards, or those of an open file from where it stands."""
    return source.open("rb") if isinstance(source, Path) else contextlib.nullcontext(source)


def pieces(file: BinaryIO, *, size_bytes: int, sha256: str, piece_bytes: int) -> Iterator[bytes]:
    """The file in pieces; the last one only comes when all of it is what it should be, so do not finish before.

    Raises:
        CorruptObjectError: it is longer, shorter, or something else.
    """
    digest, left = hashlib.sha256(), size_bytes
    while True:
        piece = file.read(min(piece_bytes, left)) if left else b""
        left -= len(piece)
        digest.update(piece)
        if left and piece:
            yield piece
            continue
        if left or file.read(1) or digest.hexdigest() != sha256:
            raise CorruptObjectError(f"what is to be stored is not {size_bytes} bytes with SHA-256 {sha256}")
        yield piece
        return
