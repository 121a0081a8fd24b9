"""The ledger of the object store: every object has a row before its first byte leaves, and until it is deleted.

A row is 'uploading' from before the upload starts; 'stored' by the transaction that makes something refer to the
object; 'doomed' by the transaction that takes the reference away. The object is deleted after that, and the row last.
So whatever stops the gateway, and wherever, no object is left that nobody knows of.

All functions but `sweep_objects` and `refreshed` are called inside the caller's writing transaction.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Protocol, TypeVar

from gateway.errors import StoreError
from gateway.store.engine import StoreEngine
from gateway.store.object_hold import objects_held
from gateway.store.objects import ObjectStore
from metaros.clock import Clock

__all__ = [
    "LEASE_S",
    "Transact",
    "announce",
    "doom",
    "in_transaction",
    "refresh",
    "refreshed",
    "stored",
    "sweep_objects",
]

Result = TypeVar("Result")
LEASE_S = 600.0  # an upload that was not refreshed for so long has no uploader any more
REFRESH_S = 60.0
SWEEP_OBJECTS = 256  # of one sweep


class Transact(Protocol):
    """Runs a job inside a writing transaction and returns its result: `in_transaction`, or the writer's thread."""

    def __call__(self, job: Callable[[StoreEngine], Result], /) -> Result:
        """The job's result, once it is committed; StoreError when it could not be."""


def in_transaction(engine: StoreEngine) -> Transact:
    """Jobs in transactions of this very engine."""

    def run(job: Callable[[StoreEngine], Result], /) -> Result:
        with engine.transaction(write=True):
            return job(engine)

    return run


def announce(engine: StoreEngine, name: str, *, kind: str, now_ns: int) -> None:
    """An upload is about to start; commit this before. `kind` is 'segment' or 'recording'.

    Raises:
        UnstorableError: the name was used before.
    """
    engine.execute("INSERT INTO objects VALUES (?, ?, 'uploading', 0, '', ?)", name, kind, now_ns)


def refresh(engine: StoreEngine, name: str, now_ns: int) -> None:
    """The upload goes on: due at least every half lease.

    Raises:
        StoreError: somebody has given it up meanwhile; stop.
    """
    _change(engine, "UPDATE objects SET since_ns = ? WHERE name = ? AND state = 'uploading'", now_ns, name)


@asynccontextmanager
async def refreshed(
    run: Callable[[Callable[[StoreEngine], None]], Awaitable[None]], name: str, clock: Clock
) -> AsyncIterator[None]:
    """Keep the lease of a long upload while the block runs; `run` runs a job inside a writing transaction."""

    async def keep() -> None:
        while True:
            await asyncio.sleep(REFRESH_S)
            await run(lambda engine: refresh(engine, name, now_ns=clock.wall_ns()))

    task = asyncio.create_task(keep())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def stored(engine: StoreEngine, name: str, *, size_bytes: int, sha256: str, now_ns: int) -> None:
    """The upload is complete; in the same transaction something begins to refer to it.

    Raises:
        StoreError: somebody has given it up meanwhile; nothing may refer to it.
    """
    update = (
        "UPDATE objects SET state = 'stored', size_bytes = ?, sha256 = ?, since_ns = ?"
        " WHERE name = ? AND state = 'uploading'"
    )
    _change(engine, update, size_bytes, sha256, now_ns, name)


def doom(engine: StoreEngine, name: str, now_ns: int) -> None:
    """Nothing refers to the object any more, and nobody uploads it; a sweep deletes it. Does nothing to no object.

    One whose upload had not ended well is deleted a lease later: a server may be about to finish it all the same.
    """
    later_ns = now_ns + round(LEASE_S * 1e9)
    update = (
        "UPDATE objects SET since_ns = CASE WHEN state = 'uploading' THEN CAST(? AS BIGINT) ELSE CAST(? AS BIGINT) END,"
        " state = 'doomed' WHERE name = ? AND state <> 'doomed'"
    )
    engine.execute(update, later_ns, now_ns, name)


def sweep_objects(
    run: Transact, objects: ObjectStore, *, now_ns: int, lease_s: float = LEASE_S, limit: int = SWEEP_OBJECTS
) -> int:
    """Delete doomed objects, give up uploads that nobody refreshed; how many objects went.

    Raises:
        StoreError, ObjectStoreError: one of the two stores cannot do it now; the next sweep goes on from there.
    """
    lease_ns = round(lease_s * 1e9)
    names = run(lambda engine: _due(engine, now_ns, lease_ns, limit))
    gone = []
    try:
        for name in names:
            objects.delete(name)
            gone.append((name,))
    finally:
        if gone:
            run(lambda engine: engine.many("DELETE FROM objects WHERE name = ? AND state = 'doomed'", gone))
    objects.sweep(before_ns=now_ns - lease_ns)
    return len(gone)


def _due(engine: StoreEngine, now_ns: int, lease_ns: int, limit: int) -> list[str]:
    """The objects to delete now.

    A given up upload waits for another lease: its uploader may only be slow, and the object appear after all. None
    goes while a backup copies them.
    """
    if objects_held(engine, now_ns=now_ns):
        return []
    engine.execute(
        "UPDATE objects SET state = 'doomed', since_ns = ? WHERE state = 'uploading' AND since_ns < ?",
        now_ns + lease_ns,
        now_ns - lease_ns,
    )
    due = "SELECT name FROM objects WHERE state = 'doomed' AND since_ns <= ? ORDER BY since_ns LIMIT ?"
    return [str(row[0]) for row in engine.fetch(due, now_ns, limit)]


def _change(engine: StoreEngine, update: str, *values: object) -> None:
    if engine.execute(update, *values) != 1:
        raise StoreError(f"the upload of {values[-1]} was given up meanwhile")
