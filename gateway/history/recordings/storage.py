"""Stores recordings: a complete file becomes an object, and its row is set to `stored`, in one step.

The ledger knows of the object before its first byte leaves, and until a recording refers to it, it is nobody's: a
gateway that dies in between leaves nothing behind that housekeeping would not find.
"""

from __future__ import annotations

import contextlib
import io
import secrets
import threading
from pathlib import Path

from gateway.domain.fleet.recording import STORED, Recording
from gateway.errors import ObjectStoreError
from gateway.history.recordings.rows import Rows
from gateway.history.recordings.transfer import OnThread
from gateway.store import ledger
from gateway.store.engine import StoreEngine
from gateway.store.fleet.recordings import change_recording, remove_recording
from gateway.store.objects import ObjectStore
from metaros.clock import Clock

__all__ = ["RecordingStorage"]

KIND = "recording"


class _File(io.FileIO):
    """A file whose reading ends with an error when the gateway does: an upload must not hold that up."""

    def __init__(self, path: Path, closing: threading.Event) -> None:
        super().__init__(path)
        self._closing = closing

    def read(self, size: int | None = -1, /) -> bytes:
        """As ever, until the gateway closes."""
        if self._closing.is_set():
            raise ObjectStoreError("the gateway is closing")
        return super().read(-1 if size is None else size) or b""


class RecordingStorage:
    """Puts files into the object store and takes them out."""

    def __init__(self, rows: Rows, objects: ObjectStore, *, on_thread: OnThread, clock: Clock) -> None:
        self._rows = rows
        self._objects = objects
        self._on_thread = on_thread
        self._clock = clock
        self._closing = threading.Event()

    def close(self) -> None:
        """End what is being put."""
        self._closing.set()

    async def keep(self, recording_id: str, path: Path, *, size_bytes: int, sha256: str) -> bool:
        """Store a whole file; False when nobody wants it any more.

        Raises:
            ObjectStoreError: the object store cannot take it now.
            StoreError: the database cannot.
        """
        name = f"recordings/{recording_id.lower()}-{secrets.token_hex(4)}.mcap"
        await self._rows.run(lambda engine: ledger.announce(engine, name, kind=KIND, now_ns=self._clock.wall_ns()))
        try:
            async with ledger.refreshed(self._rows.run, name, self._clock):
                await self._on_thread(self._put, name, path, size_bytes, sha256)
            return await self._rows.run(lambda engine: self._stored(engine, recording_id, name, size_bytes, sha256))
        except Exception:
            # Not when this task is cancelled: its thread may still be putting, and the ledger's lease covers that.
            with contextlib.suppress(Exception):
                await self._rows.run(lambda engine: self._doom_upload(engine, recording_id, name))
            raise

    async def remove(self, recording_id: str) -> Recording | None:
        """Delete a recording; its object goes with the next housekeeping. None: there is no such recording."""
        return await self._rows.run(lambda engine: self._remove(engine, recording_id))

    def _put(self, name: str, path: Path, size_bytes: int, sha256: str) -> None:
        with _File(path, self._closing) as file:
            self._objects.put(name, file, size_bytes=size_bytes, sha256=sha256)

    def _stored(self, engine: StoreEngine, recording_id: str, name: str, size_bytes: int, sha256: str) -> bool:
        now_ns = self._clock.wall_ns()
        kept = change_recording(
            engine, recording_id, state=STORED, object=name, received_bytes=size_bytes, live_ns=now_ns, message=""
        )
        if kept:
            ledger.stored(engine, name, size_bytes=size_bytes, sha256=sha256, now_ns=now_ns)
        else:
            ledger.doom(engine, name, now_ns=now_ns)
        return kept

    def _doom_upload(self, engine: StoreEngine, recording_id: str, name: str) -> None:
        """A commit that broke may have happened: what a row names stays."""
        if not engine.fetch("SELECT 1 FROM recordings WHERE object = ?", name):
            ledger.doom(engine, name, now_ns=self._clock.wall_ns())

    def _remove(self, engine: StoreEngine, recording_id: str) -> Recording | None:
        removed = remove_recording(engine, recording_id)
        if removed is not None and removed.object is not None:
            ledger.doom(engine, removed.object, now_ns=self._clock.wall_ns())
        return removed
