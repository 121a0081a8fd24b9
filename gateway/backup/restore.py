"""Restores a store from a backup: objects first, then the database in one step, which completes the restore.

Whoever is broken off begins again: objects that are there already are not sent a second time. The database comes from
a copy that was brought up to date and to today beside its place.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from gateway.backup.invalidate import Invalidated, invalidate
from gateway.backup.manifest import OBJECTS, Manifest, key_mark, moment, read_sums
from gateway.backup.snapshot import OnStep, settle
from gateway.backup.tables import copy_rows, occupied
from gateway.backup.verify import verify
from gateway.errors import CorruptObjectError
from gateway.identity.certificates.root_key import sync_folder, write_secret
from gateway.identity.master import MASTER_KEY, key_file, read_key_file
from gateway.store.engine import StoreEngine
from gateway.store.engines import open_engine
from gateway.store.object_store_marker import MARK
from gateway.store.objects import ObjectStore
from gateway.store.private_dir import make_private
from gateway.store.schema import MIGRATIONS
from gateway.store.sqlite import DATABASE, SqliteEngine
from gateway.store.store import lock_folder
from metaros.clock import Clock
from metaros.errors import ConfigError

__all__ = ["Restored", "restore"]


class Restored(NamedTuple):
    """Of what the store was made, how many objects were sent, what was ended, and whether its key is missing here."""

    manifest: Manifest
    sent: int
    invalidated: Invalidated
    keyless: bool


def restore(
    backup: Path, objects: ObjectStore, *, url: str, data_dir: Path, clock: Clock, who: str, on_step: OnStep
) -> Restored:
    """Make the store at `url` ("": in `data_dir`) and `objects` of a backup, which is read through first.

    Raises:
        ConfigError: the place is not empty, or in use; the backup is a newer program's; another master key is here.
        CorruptObjectError: the backup is damaged. Nothing was changed.
        StoreError, ObjectStoreError: one of the stores cannot be written; there is no store, and it may be tried again.
    """
    checked = verify(backup, on_step=on_step)
    manifest = checked.manifest
    if checked.faults:
        raise CorruptObjectError(f"the backup {backup} is damaged:\n" + "\n".join(checked.faults[:10]))
    if manifest.schema > len(MIGRATIONS):
        raise ConfigError(
            f"the backup has schema {manifest.schema}, this program knows {len(MIGRATIONS)}: use a newer program"
        )
    folder = make_private(data_dir)
    with contextlib.closing(lock_folder(folder)), _target(url, folder) as target:
        key = _key_of(backup, manifest, folder)
        _own(backup, objects)
        with tempfile.TemporaryDirectory(prefix=".restore-", dir=folder) as stage:
            invalidated = _stage(backup, Path(stage), manifest, clock=clock, who=who)
            sent = _send(backup, objects, manifest, on_step)
            if manifest.with_master_key and not key_file(folder).exists():
                write_secret(key_file(folder), key)
            _publish(Path(stage), target, folder, on_step)
    keyless = bool(manifest.master_key) and not key_file(folder).exists()
    return Restored(manifest, sent, invalidated, keyless)


@contextlib.contextmanager
def _target(url: str, folder: Path) -> Iterator[StoreEngine | None]:
    """The empty database; None: the file is to be moved into its place."""
    if not url:
        if (folder / DATABASE).exists():
            raise ConfigError(f"there is a store in {folder} already\nA backup is restored where there is none.")
        yield None
        return
    engine, _ = open_engine(url, folder)
    try:
        _check_empty(engine)
        yield engine
    finally:
        engine.close()


def _check_empty(engine: StoreEngine) -> None:
    with engine.transaction(write=False):
        table = occupied(engine)
    if table is not None:
        raise ConfigError(
            f"the database is not empty: there are rows in {table}\nA backup is restored where there is no store."
        )


def _key_of(backup: Path, manifest: Manifest, folder: Path) -> bytes:
    """The master key of the backup, b"" where it has none. ConfigError when another one is here."""
    key = read_key_file(backup / MASTER_KEY) if manifest.with_master_key else b""
    mine = key_file(folder)
    if manifest.master_key and mine.exists() and key_mark(read_key_file(mine)) != manifest.master_key:
        raise ConfigError(
            f"{mine} is another key than the one that sealed this store's secrets\n"
            "Put the right one there, or move this one away."
        )
    return key


def _own(backup: Path, objects: ObjectStore) -> None:
    """ConfigError when another store keeps its objects there."""
    ours = {part.name for part in read_sums(backup) if part.name.startswith(f"{OBJECTS}/{MARK}/")}
    for info in objects.names(f"{MARK}/"):
        if f"{OBJECTS}/{info.name}" not in ours:
            raise ConfigError(f"{objects.where} has the objects of another store: see --objects")


def _stage(backup: Path, stage: Path, manifest: Manifest, *, clock: Clock, who: str) -> Invalidated:
    """The database in a folder beside its place, with today's tables, and fit for today."""
    shutil.copyfile(backup / DATABASE, stage / DATABASE)
    engine = SqliteEngine(stage)
    try:
        engine.open()
        with engine.transaction(write=True):
            taken = moment(manifest.taken_ns)
            invalidated = invalidate(engine, taken_ns=manifest.taken_ns, now_ns=clock.wall_ns(), taken=taken, who=who)
    finally:
        engine.close()
    settle(stage / DATABASE)
    (stage / DATABASE).chmod(0o600)
    return invalidated


def _send(backup: Path, objects: ObjectStore, manifest: Manifest, on_step: OnStep) -> int:
    """Every object that is not there yet; how many. A name has never other bytes, so its size tells whether it is."""
    there = {info.name: info.size_bytes for info in objects.names()}
    sent = done = 0
    for part in read_sums(backup):
        if not part.name.startswith(f"{OBJECTS}/"):
            continue
        name, path = part.name[len(OBJECTS) + 1 :], backup / part.name
        size_bytes = path.stat().st_size
        if there.get(name) != size_bytes:
            objects.put(name, path, size_bytes=size_bytes, sha256=part.sha256)
            sent += 1
        done += 1
        on_step("objects", done, manifest.objects)
    return sent


def _publish(stage: Path, target: StoreEngine | None, folder: Path, on_step: OnStep) -> None:
    """From here on there is a store."""
    if target is None:
        for left in ("-wal", "-shm"):  # of a database that somebody deleted: its changes are not this one's
            (folder / f"{DATABASE}{left}").unlink(missing_ok=True)
        (stage / DATABASE).replace(folder / DATABASE)
        sync_folder(folder)
        return
    source = SqliteEngine(stage)
    try:
        with target.transaction(write=True), source.transaction(write=False):
            if (table := occupied(target)) is not None:
                raise ConfigError(f"somebody has begun to use the database meanwhile: there are rows in {table}")
            copy_rows(source, target, on_table=on_step)
    finally:
        source.close()
