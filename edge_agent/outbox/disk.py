"""The disk as the outbox needs it: eight operations, each all or nothing, with the errors told apart.

`OsDisk` is the real one. Tests have a second, which forgets what was not synced when it crashes and fails any call.
Names are relative and have one level of folders (`bulk/000000000001.seg`). A write that comes back short, as it does
on a full disk, is undone before the error is raised.
"""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

from edge_agent.errors import DiskError, DiskFullError

__all__ = ["Disk", "OsDisk"]

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_DRAFT = ".tmp"


class Disk(Protocol):
    """Files below one directory. Every method blocks; DiskFullError and DiskError are all it raises."""

    def names(self, folder: str) -> list[str]:
        """The files of a folder, sorted; drafts that a crash left behind are removed and not named."""

    def size(self, name: str) -> int:
        """Bytes of a file; 0 when there is none."""

    def read(self, name: str, offset: int, size: int) -> bytes:
        """At most `size` bytes of a file."""

    def append(self, name: str, offset: int, data: bytes) -> None:
        """Cut the file at `offset`, write `data` there and sync it; undone when it fails."""

    def replace(self, name: str, data: bytes) -> None:
        """Put a synced file in the place of whatever has that name, at once or not at all."""

    def remove(self, name: str) -> None:
        """Delete a file; nothing happens when there is none."""

    def free(self) -> tuple[int, int]:
        """Free and all bytes of the file system, as far as this user may use them."""

    def reserve(self, name: str, size: int) -> None:
        """Make a file that really occupies `size` bytes; 0 gives them back."""


class OsDisk:
    """A directory. `calls` is `os`, or what stands in for it where a test fails system calls."""

    def __init__(self, root: Path, *, calls: Any = os) -> None:
        self._root = root
        self._os = calls
        with _as_disk_error("create", str(root)):
            root.mkdir(parents=True, exist_ok=True)

    def names(self, folder: str) -> list[str]:
        """The files of a folder, sorted; drafts that a crash left behind are removed and not named."""
        path = self._root / folder
        with _as_disk_error("list", folder):
            path.mkdir(exist_ok=True)
            found = sorted(entry.name for entry in path.iterdir() if entry.is_file())
        for name in found:
            if name.endswith(_DRAFT):
                self.remove(f"{folder}/{name}")
        return [f"{folder}/{name}" for name in found if not name.endswith(_DRAFT)]

    def size(self, name: str) -> int:
        """Bytes of a file; 0 when there is none."""
        try:
            return int(self._os.stat(self._root / name).st_size)
        except FileNotFoundError:
            return 0
        except OSError as error:
            raise as_disk_error("look at", name, error) from error

    def read(self, name: str, offset: int, size: int) -> bytes:
        """At most `size` bytes of a file."""
        with _as_disk_error("read", name), open(self._root / name, "rb", buffering=0) as file:
            file.seek(offset)
            return file.read(size)

    def append(self, name: str, offset: int, data: bytes) -> None:
        """Cut the file at `offset`, write `data` there and sync it; undone when it fails."""
        path = self._root / name
        with _as_disk_error("write", name):
            fresh = not path.exists()
            descriptor = self._os.open(path, os.O_WRONLY | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o600)
            try:
                self._fill(descriptor, offset, data)
            except OSError:
                with contextlib.suppress(OSError):
                    self._os.ftruncate(descriptor, offset)
                raise
            finally:
                self._os.close(descriptor)
            if fresh:
                self._sync_folder(path.parent)

    def replace(self, name: str, data: bytes) -> None:
        """Put a synced file in the place of whatever has that name, at once or not at all."""
        path = self._root / name
        draft = path.with_name(path.name + _DRAFT)
        with _as_disk_error("write", name):
            path.parent.mkdir(exist_ok=True)
            descriptor = self._os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0), 0o600)
            try:
                self._fill(descriptor, 0, data)
            except OSError:
                with contextlib.suppress(OSError):
                    self._os.unlink(draft)
                raise
            finally:
                self._os.close(descriptor)
            self._os.replace(draft, path)
            self._sync_folder(path.parent)

    def remove(self, name: str) -> None:
        """Delete a file; nothing happens when there is none."""
        with _as_disk_error("remove", name), contextlib.suppress(FileNotFoundError):
            self._os.unlink(self._root / name)

    def free(self) -> tuple[int, int]:
        """Free and all bytes of the file system, as far as this user may use them."""
        with _as_disk_error("look at", "the file system"):
            if not hasattr(os, "statvfs"):  # Windows
                import shutil

                usage = shutil.disk_usage(self._root)
                return usage.free, usage.total
            facts = self._os.statvfs(self._root)
            return facts.f_bavail * facts.f_frsize, facts.f_blocks * facts.f_frsize

    def reserve(self, name: str, size: int) -> None:
        """Make a file that really occupies `size` bytes; 0 gives them back."""
        if size == 0:
            self.remove(name)
        elif self.size(name) != size:
            try:
                self.append(name, 0, bytes(size))
            except DiskFullError:
                self.remove(name)
                raise

    def _fill(self, descriptor: int, offset: int, data: bytes) -> None:
        """Cut, write all, sync."""
        self._os.ftruncate(descriptor, offset)
        self._os.lseek(descriptor, offset, os.SEEK_SET)
        view = memoryview(data)
        while view:
            written = self._os.write(descriptor, view)
            if written == 0:
                raise OSError(errno.ENOSPC, "nothing was written")
            view = view[written:]
        sync = getattr(self._os, "fdatasync", self._os.fsync)
        sync(descriptor)

    def _sync_folder(self, path: Path) -> None:
        """Make a new name last; Windows has no such call and needs none."""
        if os.name == "nt":
            return
        descriptor = self._os.open(path, os.O_RDONLY)
        try:
            self._os.fsync(descriptor)
        finally:
            self._os.close(descriptor)


@contextlib.contextmanager
def _as_disk_error(verb: str, name: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise as_disk_error(verb, name, error) from error


def as_disk_error(verb: str, name: str, error: OSError) -> DiskError:
    """An OSError as DiskFullError or DiskError."""
    kind = DiskFullError if error.errno in _FULL else DiskError
    return kind(f"cannot {verb} {name}: {error.strerror or error}")
