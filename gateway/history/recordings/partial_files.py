"""Partial files: what has been received of each recording, in a file of its own until it is complete.

Everything here blocks and runs on threads. A file carries its recording's id and the beginning of its checksum in its
name, so that a robot that cut the span again never continues another file.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

from gateway.domain.fleet.recording import is_recording_id
from gateway.errors import StoreError

__all__ = ["PartialFile", "PartialFiles"]

SUFFIX = ".partial"
READ_BYTES = 1024 * 1024
_SHA256 = re.compile(r"[0-9a-f]{64}")


class PartialFile:
    """One recording's bytes from 0 to `size()`."""

    def __init__(self, path: Path, *, reserve_bytes: int) -> None:
        self.path = path
        self._reserve_bytes = reserve_bytes

    def size(self) -> int:
        """How many bytes are there; 0 without a file."""
        try:
            return self.path.stat().st_size
        except FileNotFoundError:
            return 0

    def append(self, offset: int, pieces: Sequence[bytes]) -> int:
        """Write after byte `offset`, and return the new size once the disk has it.

        Raises:
            StoreError: the disk is full, but for what is kept free for others, or it failed; nothing was added.
        """
        coming = sum(map(len, pieces))
        try:
            new = not self.path.exists()
            free = shutil.disk_usage(self.path.parent).free
            if free - coming < self._reserve_bytes:
                raise StoreError(f"the gateway's disk is full: {free >> 20} MiB are free")
            with self.path.open("wb" if new else "r+b") as file:
                file.seek(offset)
                file.writelines(pieces)
                file.truncate()
                file.flush()
                os.fsync(file.fileno())
            if new:
                _sync_folder(self.path.parent)
        except OSError as error:
            self._cut(offset)
            raise StoreError(f"the gateway's disk failed: {error}") from error
        return offset + coming

    def digest(self) -> str:
        """The SHA-256 of what is there, in hexadecimal digits, "" without a file; StoreError when it cannot be read."""
        digest = hashlib.sha256()
        try:
            with self.path.open("rb") as file:
                while piece := file.read(READ_BYTES):
                    digest.update(piece)
        except FileNotFoundError:
            return ""
        except OSError as error:
            raise StoreError(f"the gateway's disk failed: {error}") from error
        return digest.hexdigest()

    def discard(self) -> None:
        """Delete it."""
        self.path.unlink(missing_ok=True)

    def _cut(self, offset: int) -> None:
        """Take back what a failed write may have left."""
        try:
            if self.size() > offset:
                os.truncate(self.path, offset)
        except OSError:
            return  # the next append truncates, and the checksum has the last word


class PartialFiles:
    """The folder of all of them."""

    def __init__(self, folder: Path, *, reserve_bytes: int) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._reserve_bytes = reserve_bytes

    def file(self, recording_id: str, *, sha256: str, size_bytes: int) -> PartialFile:
        """The file of a recording with that content, with what came earlier; ValueError for what would be a path."""
        if not is_recording_id(recording_id) or not _SHA256.fullmatch(sha256):
            raise ValueError(f"{recording_id[:40]!r} of {sha256[:80]!r}: no id of a recording, or no checksum")
        path = self._folder / f"{recording_id}-{sha256[:16]}{SUFFIX}"
        partial = PartialFile(path, reserve_bytes=self._reserve_bytes)
        if partial.size() > size_bytes:
            partial.discard()
        return partial

    def discard(self, recording_id: str) -> None:
        """Delete whatever there is of a recording; ValueError for what is no id."""
        if not is_recording_id(recording_id):
            raise ValueError(f"{recording_id[:40]!r}: no id of a recording")
        for path in self._folder.glob(f"{recording_id}-*{SUFFIX}"):
            path.unlink(missing_ok=True)

    def ids(self) -> set[str]:
        """The recordings of which there is something."""
        found = {path.name.partition("-")[0] for path in self._folder.glob(f"*{SUFFIX}")}
        return set(filter(is_recording_id, found))  # what else is there is not ours


def _sync_folder(folder: Path) -> None:
    """Make a new file's name last; Windows cannot open a folder, and needs it not."""
    if os.name != "nt":
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
