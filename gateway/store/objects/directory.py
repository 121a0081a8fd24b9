"""Objects as files of a directory: the default."""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

from gateway.errors import GatewayError, ObjectMissingError, ObjectRefusedError, ObjectStoreError
from gateway.store.objects.store import ObjectInfo, Source, check_name, opened, pieces

__all__ = ["DirectoryStore"]

PARTIAL = ".partial"
WRITE_BYTES = 1 << 20
_NO_LINK = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


class DirectoryStore:
    """Writes to a file beside, syncs it and renames it; several gateways may share the directory."""

    def __init__(self, root: Path) -> None:
        self._root = root

    @property
    def where(self) -> str:
        """The directory."""
        return str(self._root)

    def put(self, name: str, source: Source, *, size_bytes: int, sha256: str) -> None:
        """Keep the rest of `source` under `name`; it and its name are on the disk when this returns."""
        path = self._path(name)
        partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}{PARTIAL}")
        with _errors(name, missing=ObjectStoreError), opened(source) as file:
            self._make_folder(path.parent)
            try:
                with open(_create(partial), "wb") as target:
                    for piece in pieces(file, size_bytes=size_bytes, sha256=sha256, piece_bytes=WRITE_BYTES):
                        target.write(piece)
                    target.flush()
                    os.fsync(target.fileno())
                partial.replace(path)
            except BaseException:
                partial.unlink(missing_ok=True)
                raise
            _sync_folder(path.parent)

    def read(self, name: str, *, start: int = 0, size_bytes: int | None = None) -> bytes:
        """That range of the file, or what there is of it."""
        with _errors(name), open(os.open(self._path(name), os.O_RDONLY | _NO_LINK), "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise ObjectMissingError(f"{name} is no file")
            file.seek(start)
            return file.read(-1 if size_bytes is None else size_bytes)

    def names(self, prefix: str = "") -> Iterator[ObjectInfo]:
        """Every object whose name begins with `prefix`."""
        for path, status in self._files(self._root):
            name = path.relative_to(self._root).as_posix()
            if name.startswith(prefix) and not name.endswith(PARTIAL):
                yield ObjectInfo(name, status.st_size, status.st_mtime_ns)

    def delete(self, name: str) -> None:
        """The file is gone, whether it was there or not."""
        path = self._path(name)
        with _errors(name):
            try:
                path.unlink()
            except (FileNotFoundError, NotADirectoryError):
                return
            _sync_folder(path.parent)

    def sweep(self, *, before_ns: int) -> int:
        """Delete the unfinished files that nobody has written to since."""
        left = [path for path, status in self._files(self._root) if _abandoned(path, status, before_ns)]
        for path in left:
            with _errors(path.name):
                path.unlink(missing_ok=True)
        return len(left)

    def close(self) -> None:
        """Nothing is held."""

    def _path(self, name: str) -> Path:
        path = self._root / check_name(name)
        for parent in path.parents:
            if parent == self._root:
                break
            if parent.is_symlink():
                raise ObjectRefusedError(f"{parent} is a link; objects lie in {self._root} itself")
        return path

    def _make_folder(self, folder: Path) -> None:
        """Make what is missing of the folders, each durable in the one above."""
        missing = [each for each in (folder, *folder.parents) if not each.exists()]
        for each in reversed(missing):
            each.mkdir(exist_ok=True)
            _sync_folder(each.parent)

    def _files(self, folder: Path) -> Iterator[tuple[Path, os.stat_result]]:
        """Every regular file below; what vanishes meanwhile is left out."""
        with _errors(str(folder)):
            try:
                entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
            except FileNotFoundError:
                return
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                yield from self._files(Path(entry.path))
            elif entry.is_file(follow_symlinks=False):
                with contextlib.suppress(FileNotFoundError):
                    yield Path(entry.path), entry.stat(follow_symlinks=False)


def _abandoned(path: Path, status: os.stat_result, before_ns: int) -> bool:
    return path.name.endswith(PARTIAL) and status.st_mtime_ns < before_ns


def _create(path: Path) -> int:
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_LINK, 0o600)


def _sync_folder(folder: Path) -> None:
    """Make the names in it durable; Windows does so itself, and opens no folders."""
    if sys.platform != "win32":
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


@contextlib.contextmanager
def _errors(name: str, *, missing: type[GatewayError] = ObjectMissingError) -> Iterator[None]:
    try:
        yield
    except (FileNotFoundError, IsADirectoryError, NotADirectoryError) as error:
        raise missing(f"there is no object {name}: {error.strerror}") from error
    except PermissionError as error:
        raise ObjectRefusedError(f"{name}: {error}") from error
    except OSError as error:
        raise ObjectStoreError(f"{name}: {error}") from error
