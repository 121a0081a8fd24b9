"""Verifies a backup: is every file unchanged, and is every object there?"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from gateway.backup.manifest import OBJECTS, SUMS, Manifest, Part, read_manifest, read_sums, sum_of
from gateway.backup.snapshot import OnStep
from gateway.backup.take import referenced_objects
from gateway.errors import DamagedError
from gateway.store.sqlite import DATABASE

__all__ = ["Verified", "verify"]

MOST = 100  # faults that are named


class Verified(NamedTuple):
    """What the backup says of itself, how many files were read through, and what is wrong with them."""

    manifest: Manifest
    files: int
    faults: tuple[str, ...]


def verify(folder: Path, *, on_step: OnStep) -> Verified:
    """Read all of it, and compare the checksums, the database's own structure and the objects that it refers to.

    Raises:
        ConfigError, CorruptObjectError: this is no whole backup.
    """
    manifest = read_manifest(folder)
    faults: list[str] = []
    files = 0
    try:
        if sum_of(folder / SUMS)[0] != manifest.sums:
            return Verified(manifest, 0, (f"{SUMS}: it is not the one that was written",))
        for part in read_sums(folder):
            files += 1
            faults += _faults_of(folder, part)
            on_step("files", files, max(files, manifest.objects + 1))
        if not any(fault.startswith(DATABASE) for fault in faults):
            faults += _faults_inside(folder, manifest)
    except (OSError, DamagedError) as error:
        faults.append(str(error))
    return Verified(manifest, files, tuple(faults[:MOST]))


def _faults_of(folder: Path, part: Part) -> Iterator[str]:
    try:
        if sum_of(folder / part.name)[0] != part.sha256:
            yield f"{part.name}: its SHA-256 is another one than it was"
    except OSError as error:
        yield f"{part.name}: {error.strerror or error}"


def _faults_inside(folder: Path, manifest: Manifest) -> Iterator[str]:
    """The database by its own check and by its id; every object that it refers to is in the list of checksums."""
    uri = f"{(folder / DATABASE).absolute().as_uri()}?mode=ro&immutable=1"
    try:
        with contextlib.closing(sqlite3.connect(uri, uri=True)) as copy:
            for (text,) in copy.execute("PRAGMA quick_check(10)"):
                if text != "ok":
                    yield f"{DATABASE}: {text}"
            rows = copy.execute("SELECT value FROM meta WHERE key = 'store_id'").fetchall()
        if rows != [(manifest.store_id,)]:
            yield f"{DATABASE}: it is another store's"
        listed = (part for part in read_sums(folder) if part.name.startswith(f"{OBJECTS}/"))
        there = next(listed, None)
        for one in referenced_objects(folder / DATABASE):
            if there == Part(one.sha256, f"{OBJECTS}/{one.name}"):
                there = next(listed, None)
            elif one.name not in manifest.damaged:
                yield f"{OBJECTS}/{one.name}: the database refers to it, and it is not in the backup"
    except sqlite3.Error as error:
        yield f"{DATABASE}: {error}"
