"""Takes a backup: a database snapshot, then every object that it refers to, then the manifest that completes it.

It is made beside its place, and gets its name when all of it is on the disk: what has the name is whole. Objects are
held in the store until they are copied, see `gateway/store/object_hold.py`; their bytes are checksummed on the way.
"""

from __future__ import annotations

import contextlib
import io
import os
import secrets
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import metaros
from gateway.backup.manifest import MANIFEST, OBJECTS, SUMS, Manifest, Part, key_mark, sum_of, write_line
from gateway.backup.snapshot import OnStep, facts_of, snapshot
from gateway.errors import DamagedError
from gateway.identity.certificates.root_key import sync_folder, write_secret
from gateway.identity.master import MASTER_KEY, key_file, next_file, read_key_file
from gateway.store.engine import StoreEngine
from gateway.store.ledger import in_transaction
from gateway.store.object_hold import hold_objects, release_objects
from gateway.store.object_store_marker import find_marker
from gateway.store.objects import DirectoryStore, ObjectStore, chunks
from metaros.clock import Clock
from metaros.errors import ConfigError

__all__ = ["ReferencedObject", "referenced_objects", "take"]

PARTIAL = ".partial"
RENEW_S = 60.0
_KEPT = (
    "SELECT name, size_bytes, sha256 FROM objects WHERE state = 'stored' UNION SELECT object, size_bytes, sha256"
    " FROM lambda_code WHERE EXISTS (SELECT 1 FROM lambda_records r WHERE r.code = lambda_code.sha256) ORDER BY 1"
)


class ReferencedObject(NamedTuple):
    """An object that a store refers to."""

    name: str
    size_bytes: int
    sha256: str


@dataclass(slots=True)
class _Hold:
    """Keeps objects from being deleted; `keep` is to be called again and again."""

    engine: StoreEngine
    clock: Clock
    holder: str
    said_s: float = float("-inf")

    def keep(self) -> None:
        if self.clock.monotonic_s() - self.said_s < RENEW_S:
            return
        self.said_s, now_ns = self.clock.monotonic_s(), self.clock.wall_ns()
        in_transaction(self.engine)(lambda engine: hold_objects(engine, self.holder, now_ns=now_ns))

    def end(self) -> None:
        in_transaction(self.engine)(lambda engine: release_objects(engine, self.holder))


class _Stream(io.RawIOBase):
    """Pieces as a file to read from; `on_piece` is called with each."""

    def __init__(self, pieces: Iterator[bytes], on_piece: Callable[[], None]) -> None:
        super().__init__()
        self._pieces = pieces
        self._on_piece = on_piece
        self._rest = memoryview(b"")

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        if not self._rest:
            self._on_piece()
            self._rest = memoryview(next(self._pieces, b""))
        count = min(len(buffer), len(self._rest))
        buffer[:count] = self._rest[:count]
        self._rest = self._rest[count:]
        return count


def take(
    engine: StoreEngine,
    objects: ObjectStore,
    folder: Path,
    *,
    where: str,
    data_dir: Path,
    with_master_key: bool,
    clock: Clock,
    on_step: OnStep,
) -> Manifest:
    """Make the backup `folder`; a gateway may be at work on the store. `where`: what people call the database.

    Raises:
        ConfigError: there is such a folder already, there is no room, no store, or no master key to put in.
        ObjectRefusedError: these are not the store's objects, so that nearly all would be missing.
        StoreError, ObjectStoreError: one of the stores cannot be read now; nothing is left of the backup.
    """
    store_id, schema = facts_of(engine, where)
    find_marker(engine, objects)
    key = _master_key(data_dir, needed=with_master_key)
    partial = _place(folder)
    hold = _Hold(engine, clock, secrets.token_hex(8))
    try:
        hold.keep()  # before the moment: what it refers to is still there when its turn comes
        taken_ns = clock.wall_ns()
        database = snapshot(engine, partial, on_step=on_step)
        parts, size_bytes, damaged = _copy_objects(database, objects, partial, hold.keep, on_step)
        if with_master_key:
            write_secret(partial / MASTER_KEY, key)
        manifest = Manifest(
            store_id=store_id,
            taken_ns=taken_ns,
            database="postgresql" if engine.shared else "sqlite",
            schema=schema,
            version=metaros.__version__,
            objects=parts,
            size_bytes=size_bytes,
            sums=_add_sums(partial, [database, *([partial / MASTER_KEY] if with_master_key else [])]),
            master_key=key_mark(key) if key else "",
            with_master_key=with_master_key,
            damaged=damaged,
        )
        write_secret(partial / MANIFEST, manifest.text())
        partial.rename(folder)
        sync_folder(folder.parent)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    finally:
        hold.end()
    return manifest


def referenced_objects(database: Path) -> Iterator[ReferencedObject]:
    """The objects that the copy of a database refers to, by name; it is not written to."""
    uri = f"{database.absolute().as_uri()}?mode=ro&immutable=1"
    with contextlib.closing(sqlite3.connect(uri, uri=True)) as copy:
        for row in copy.execute(_KEPT):
            yield ReferencedObject(*row)


def _copy_objects(
    database: Path, objects: ObjectStore, folder: Path, keep: Callable[[], None], on_step: OnStep
) -> tuple[int, int, list[str]]:
    """How many there are, how large they and the database are; and the names of those that the store has no more."""
    total = size_bytes = 0
    for one in referenced_objects(database):
        total, size_bytes = total + 1, size_bytes + one.size_bytes
    free = shutil.disk_usage(folder).free
    if free < size_bytes:
        raise ConfigError(f"the objects have {size_bytes} bytes, and where the backup is to be {free} are free")
    copies, damaged, count = DirectoryStore(folder / OBJECTS), [], 0
    with _private(folder / SUMS) as sums:
        for done, one in enumerate(referenced_objects(database), 1):
            source = io.BufferedReader(_Stream(chunks(objects, one.name), keep))
            try:
                copies.put(one.name, source, size_bytes=one.size_bytes, sha256=one.sha256)
                sums.write(write_line(Part(one.sha256, f"{OBJECTS}/{one.name}")))
                count += 1
            except DamagedError:  # it was before; all the rest is worth keeping
                damaged.append(one.name)
            on_step("objects", done, total)
    return count, size_bytes + database.stat().st_size, damaged


def _add_sums(folder: Path, files: list[Path]) -> str:
    """The other files behind the objects; the list's own SHA-256."""
    with (folder / SUMS).open("a", encoding="utf-8") as sums:
        for path in files:
            sums.write(write_line(Part(sum_of(path)[0], path.name)))
        sums.flush()
        os.fsync(sums.fileno())
    return sum_of(folder / SUMS)[0]


def _private(path: Path) -> io.TextIOWrapper:
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8")


def _place(folder: Path) -> Path:
    """An empty folder beside the one to come."""
    partial = folder.with_name(folder.name + PARTIAL)
    if folder.exists():
        raise ConfigError(f"{folder} is there already; a backup gets a folder of its own")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial.mkdir(mode=0o700)
    except FileExistsError as error:
        raise ConfigError(
            f"{partial} is there: another backup is being taken to this place, or was broken off\n"
            "Delete it when none is."
        ) from error
    except OSError as error:
        raise ConfigError(f"{partial} cannot be made: {error.strerror or error}") from error
    return partial


def _master_key(data_dir: Path, *, needed: bool) -> bytes:
    """The master key; b"" where none was made yet."""
    file = key_file(data_dir)
    if next_file(file).exists():
        raise ConfigError("the master key is being replaced: let `metaros gateway rekey` come to its end first")
    if needed or file.exists():
        return read_key_file(file)
    return b""
