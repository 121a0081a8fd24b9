"""Bundles on their way in: received into a file within bounds, checked, then kept as an object that a row names."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import secrets
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

from gateway.errors import BodyTooLargeError, TooManyError
from gateway.fleet.updates.errors import UpdateRefusedError
from gateway.store import Store, ledger
from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import StoredBundle, add_bundle, bundle_at, list_bundles
from gateway.store.objects import ObjectStore
from metaros.clock import Clock
from metaros.fleet.bundle import Manifest, read_bundle, target_path
from metaros.limits import LIMITS, Limits

__all__ = ["BundleUploads"]

KIND = "bundle"
PIECE_BYTES = 1 << 20


@dataclass(slots=True)
class _File:
    """What has come of a bundle."""

    path: Path
    size_bytes: int = 0
    sha256: str = ""


class BundleUploads:
    """Takes bundles in."""

    def __init__(
        self, store: Store, objects: ObjectStore, folder: Path, *, clock: Clock, limits: Limits = LIMITS
    ) -> None:
        """`folder`: where those lie that are not whole yet; nobody else writes to it."""
        self._store = store
        self._objects = objects
        self._folder = folder
        self._clock = clock
        self._limits = limits
        self._open = 0

    def clean(self) -> None:
        """Delete what a gateway that died left behind; before the first upload."""
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        for path in self._folder.iterdir():
            with contextlib.suppress(OSError):
                path.unlink()

    async def take(self, pieces: AsyncIterator[bytes], *, group: str, by: str) -> StoredBundle:
        """A whole bundle; one that is here already, byte for byte, changes nothing.

        Raises:
            BundleError: it is none.
            BodyTooLargeError: it is over its bound.
            TooManyError: too many come at once, or are kept.
            UpdateRefusedError: there is another one of that version.
            ObjectStoreError, StoreError: it cannot be kept now.
        """
        if self._open >= self._limits.bundle_uploads:
            raise TooManyError(f"{self._limits.bundle_uploads} bundles are on their way in already")
        self._open += 1
        path = self._folder / f"{secrets.token_hex(8)}.partial"
        try:
            file = await self._receive(pieces, path)
            manifest = await asyncio.to_thread(read_bundle, path)
            return await self._keep(file, manifest, group=group, by=by)
        finally:
            self._open -= 1
            path.unlink(missing_ok=True)

    async def _receive(self, pieces: AsyncIterator[bytes], path: Path) -> _File:
        digest, file = hashlib.sha256(), _File(path)
        with await asyncio.to_thread(path.open, "wb") as target:
            held: list[bytes] = []
            held_bytes = 0
            async for piece in pieces:
                file.size_bytes += len(piece)
                if file.size_bytes > self._limits.bundle_bytes:
                    raise BodyTooLargeError(f"a bundle has at most {self._limits.bundle_bytes} bytes")
                digest.update(piece)
                held.append(piece)
                held_bytes += len(piece)
                if held_bytes >= PIECE_BYTES:
                    await asyncio.to_thread(target.write, b"".join(held))
                    held, held_bytes = [], 0
            await asyncio.to_thread(target.write, b"".join(held))
        file.sha256 = digest.hexdigest()
        return file

    async def _keep(self, file: _File, manifest: Manifest, *, group: str, by: str) -> StoredBundle:
        path = target_path(manifest.kind, manifest.name, manifest.version, group=group)
        found = await self._store.run(lambda engine: self._there(engine, path, file))
        if found is not None:
            return found
        name = f"updates/{file.sha256}-{secrets.token_hex(4)}.zip"
        bundle = StoredBundle(
            path=path,
            kind=manifest.kind,
            name=manifest.name,
            version=manifest.version,
            sha256=file.sha256,
            size_bytes=file.size_bytes,
            manifest=manifest.custom,
            object=name,
            uploaded_ns=self._clock.wall_ns(),
            uploaded_by=by,
        )
        await self._store.run(lambda engine: ledger.announce(engine, name, kind=KIND, now_ns=self._clock.wall_ns()))
        try:
            async with ledger.refreshed(self._store.run, name, self._clock):
                await asyncio.to_thread(
                    self._objects.put, name, file.path, size_bytes=file.size_bytes, sha256=file.sha256
                )
            return await self._store.run(lambda engine: self._add(engine, bundle, file))
        except Exception:
            with contextlib.suppress(Exception):
                await self._store.run(lambda engine: self._doom(engine, bundle))
            raise

    def _there(self, engine: StoreEngine, path: str, file: _File) -> StoredBundle | None:
        found = bundle_at(engine, path)
        if found is None:
            if len(list_bundles(engine, limit=self._limits.bundles)) >= self._limits.bundles:
                raise TooManyError(f"there are {self._limits.bundles} bundles already")
            return None
        if found.sha256 != file.sha256:
            raise UpdateRefusedError(f"{path} is here with other bytes: a version is for ever, so take the next number")
        return found

    def _add(self, engine: StoreEngine, bundle: StoredBundle, file: _File) -> StoredBundle:
        """Of two who bring the same one at once, the second finds it there."""
        found = self._there(engine, bundle.path, file)
        if found is not None:
            ledger.doom(engine, bundle.object, now_ns=self._clock.wall_ns())
            return found
        add_bundle(engine, bundle, now_ns=self._clock.wall_ns())
        return bundle

    def _doom(self, engine: StoreEngine, bundle: StoredBundle) -> None:
        """A commit that broke may have happened: what a row names stays."""
        found = bundle_at(engine, bundle.path)
        if found is None or found.object != bundle.object:
            ledger.doom(engine, bundle.object, now_ns=self._clock.wall_ns())
