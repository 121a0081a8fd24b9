"""Zip files of functions and layers: kept by their SHA-256 in the object store, unpacked in a folder of this gateway.

The folder is a cache with a bound: what was wanted longest ago goes first, and never what a worker has open or what
was handed out a moment ago.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import os
import secrets
import shutil
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gateway.automation.functions.errors import CodeStorageFullError, UnknownFunctionError
from gateway.errors import CorruptObjectError, ObjectMissingError, OverloadedError
from gateway.store import Store
from gateway.store.automation import functions as rows
from gateway.store.automation.functions import StoredCode
from gateway.store.engine import StoreEngine
from gateway.store.object_hold import objects_held
from gateway.store.objects import ObjectStore, chunks
from metaros.automation.functions.package import check_zip, discard, unpack
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["CodeFacts", "CodeStore"]

HANDED_S = 120.0  # that a folder stays after it was asked for: a worker may be about to open it
UNUSED_S = 3600.0  # that code is kept that no function has: its own may be about to be made
GONE = ".gone-"  # how a folder is called that is being deleted
SWEPT = 256  # zip files that one sweep deletes


@dataclass(frozen=True, slots=True)
class CodeFacts:
    """A checked zip file."""

    sha256: str
    size_bytes: int
    unpacked_bytes: int

    @property
    def document(self) -> dict[str, Any]:
        """As a record keeps it."""
        return {"code": self.sha256, "code_bytes": self.size_bytes, "unpacked_bytes": self.unpacked_bytes}


class CodeStore:
    """The code of one gateway's functions."""

    def __init__(
        self,
        store: Store,
        objects: ObjectStore,
        folder: Path,
        *,
        clock: Clock,
        in_use: Callable[[], Collection[Path]],
        limits: Limits = LIMITS,
    ) -> None:
        self._store = store
        self._objects = objects
        self._unpacked, self._incoming = folder / "unpacked", folder / "incoming"
        self._clock = clock
        self._in_use = in_use
        self._limits = limits
        self._here: set[str] = set()  # what is unpacked, as far as it is known
        self._wanted_s: dict[str, float] = {}
        self._locks: dict[str, asyncio.Lock] = {}
        self._evicting = asyncio.Lock()

    def open(self) -> None:
        """Make the folders, and forget what a former life left half done; blocks."""
        shutil.rmtree(self._incoming, ignore_errors=True)
        for folder in (self._unpacked, self._incoming):
            folder.mkdir(parents=True, exist_ok=True)
        for path in self._unpacked.glob(".*"):
            discard(path)

    async def check(self, source: bytes | Path) -> CodeFacts:
        """What a zip file holds; PackageError where it is none that may be unpacked."""
        facts = await asyncio.to_thread(check_zip, source, limits=self._limits)
        return CodeFacts(facts.sha256, facts.size_bytes, facts.unpacked_bytes)

    async def keep(self, source: bytes | Path, facts: CodeFacts) -> None:
        """Unpack it here and keep it in the object store, durable when this returns.

        Raises:
            CodeStorageFullError: all code together would be over its bound.
        """
        now_ns = self._clock.wall_ns()
        name = f"functions/{facts.sha256}-{secrets.token_hex(4)}.zip"
        wanted = StoredCode(facts.sha256, name, facts.size_bytes)

        def job(engine: StoreEngine) -> StoredCode:
            stored = rows.keep_code(engine, wanted, now_ns=now_ns)
            if (total := rows.code_bytes(engine)) > self._limits.function_codes_bytes:
                most = self._limits.function_codes_bytes
                raise CodeStorageFullError(f"All code would be {total} bytes, at most {most} are kept: delete some")
            return stored

        async with self._lock(facts.sha256):
            with self._file(source) as path:
                self._wanted_s[facts.sha256] = self._clock.monotonic_s()
                await asyncio.to_thread(self._unpack, path, facts.sha256)
                stored = await self._store.run(job)
                await asyncio.to_thread(self._put, stored, path)
        await self.evict()

    async def folder(self, sha256: str) -> Path:
        """Where code is unpacked; fetched if it is not here."""
        self._wanted_s[sha256] = self._clock.monotonic_s()
        path = self._unpacked / sha256
        if sha256 in self._here:
            return path
        async with self._lock(sha256):
            if not await asyncio.to_thread(path.is_dir):
                stored = await self._stored(sha256)
                await asyncio.to_thread(self._fetch, stored)
        self._here.add(sha256)
        await self.evict()
        return path

    async def pieces(self, sha256: str) -> tuple[int, Iterator[bytes]]:
        """A zip file's size, and what it holds, in pieces that block."""
        stored = await self._stored(sha256)
        return stored.size_bytes, chunks(self._objects, stored.object)

    async def sweep(self) -> None:
        """Delete what no function or layer has had for a while; nothing while a backup copies it."""
        now_ns = self._clock.wall_ns()

        def job(engine: StoreEngine) -> list[str]:
            if objects_held(engine, now_ns=now_ns):
                return []
            return rows.drop_unused_code(engine, before_ns=now_ns - round(UNUSED_S * 1e9), limit=SWEPT)

        for name in await self._store.run(job):
            await asyncio.to_thread(self._objects.delete, name)

    async def evict(self) -> None:
        """Delete folders until the rest is within its bound."""
        held = {path.name for path in self._in_use()}
        now_s = self._clock.monotonic_s()
        fresh = {name for name, at_s in self._wanted_s.items() if now_s - at_s < HANDED_S}
        order = sorted(self._wanted_s, key=self._wanted_s.__getitem__)
        async with self._evicting:
            left = await asyncio.to_thread(self._evict, held | fresh, order)
        self._wanted_s = {name: at_s for name, at_s in self._wanted_s.items() if name in left or name in fresh}
        if sum(left.values()) > 2 * self._limits.function_cache_bytes:
            raise OverloadedError("functions that run now have more code than this gateway unpacks at a time")

    def _lock(self, sha256: str) -> asyncio.Lock:
        """One at a time unpacks the same code; locks that nobody has are let go."""
        for name in [name for name, lock in self._locks.items() if not lock.locked()][:-8]:
            del self._locks[name]
        return self._locks.setdefault(sha256, asyncio.Lock())

    async def _stored(self, sha256: str) -> StoredCode:
        found = await self._store.read(lambda engine: _find(engine, sha256))
        if found is None:
            raise UnknownFunctionError(f"There is no code with SHA-256 {sha256}")
        return found

    @contextlib.contextmanager
    def _file(self, source: bytes | Path) -> Iterator[Path]:
        if isinstance(source, Path):
            yield source
            return
        path = self._incoming / f"{secrets.token_hex(8)}.zip"
        try:
            path.write_bytes(source)
            yield path
        finally:
            path.unlink(missing_ok=True)

    def _unpack(self, path: Path, sha256: str) -> None:
        folder = unpack(path, self._unpacked, limits=self._limits)
        if folder.name != sha256:
            raise CorruptObjectError(f"the code with SHA-256 {sha256} holds something else")

    def _put(self, stored: StoredCode, path: Path) -> None:
        """Where it is known it is there, unless a former life ended in between."""
        with contextlib.suppress(ObjectMissingError):
            if self._objects.read(stored.object, size_bytes=1):
                return
        self._objects.put(stored.object, path, size_bytes=stored.size_bytes, sha256=stored.sha256)

    def _fetch(self, stored: StoredCode) -> None:
        path = self._incoming / f"{secrets.token_hex(8)}.zip"
        digest = hashlib.sha256()
        try:
            with path.open("wb") as file:
                for piece in chunks(self._objects, stored.object):
                    digest.update(piece)
                    file.write(piece)
            if digest.hexdigest() != stored.sha256:
                raise CorruptObjectError(f"{stored.object} holds something else than it is to")
            self._unpack(path, stored.sha256)
        finally:
            path.unlink(missing_ok=True)

    def _evict(self, kept: Collection[str], order: list[str]) -> dict[str, int]:
        """Delete the longest unused; the sizes of what stays. What was not asked for in this life goes first."""
        sizes = {path.name: _size(path) for path in self._unpacked.iterdir() if not path.name.startswith(".")}
        places = {name: place for place, name in enumerate(order)}
        for name in sorted(sizes, key=lambda each: places.get(each, -1)):
            if sum(sizes.values()) <= self._limits.function_cache_bytes:
                break
            if name not in kept:
                self._here.discard(name)
                _vanish(self._unpacked / name)
                del sizes[name]
        return sizes


def _find(engine: StoreEngine, sha256: str) -> StoredCode | None:
    with engine.transaction(write=False):
        return rows.find_code(engine, sha256)


def _size(folder: Path) -> int:
    return sum(os.lstat(Path(where) / name).st_size for where, _, names in os.walk(folder) for name in names)


def _vanish(folder: Path) -> None:
    """Nobody finds it half deleted."""
    gone = folder.with_name(f"{GONE}{secrets.token_hex(8)}")
    folder.rename(gone)
    discard(gone)
