"""A marker object with the store's id, to check that an object store belongs to this store.

A small object is put there first, and stands in the ledger as every other. Where it is missing, another directory or
bucket was named than before, or than another gateway of the same database has: nothing may then be put or deleted.
"""

from __future__ import annotations

import hashlib
import io
import secrets

from gateway.errors import ObjectMissingError, ObjectRefusedError
from gateway.store.engine import StoreEngine
from gateway.store.ledger import Transact, announce, stored
from gateway.store.objects import ObjectStore
from metaros.clock import Clock

__all__ = ["MARK", "check_marker", "find_marker"]

MARK = "mark"  # the kind of these objects in the ledger


def check_marker(engine: StoreEngine, run: Transact, objects: ObjectStore, *, clock: Clock) -> None:
    """Find the mark, or set it in a store that has none yet.

    Raises:
        ObjectRefusedError: this is another object store.
        StoreError, ObjectStoreError: it cannot be told now.
    """
    if find_marker(engine, objects):
        return
    name, data = f"mark/{secrets.token_hex(8)}", b"objects of a metaros gateway; keep this\n"
    sha256 = hashlib.sha256(data).hexdigest()
    run(lambda engine: announce(engine, name, kind=MARK, now_ns=clock.wall_ns()))
    objects.put(name, io.BytesIO(data), size_bytes=len(data), sha256=sha256)
    run(lambda engine: stored(engine, name, size_bytes=len(data), sha256=sha256, now_ns=clock.wall_ns()))


def find_marker(engine: StoreEngine, objects: ObjectStore) -> bool:
    """Whether the store has a mark, which is there; ObjectRefusedError where another object store was named."""
    with engine.transaction(write=False):
        rows = engine.fetch("SELECT name FROM objects WHERE kind = ? AND state = 'stored'", MARK)
    for name in (str(row[0]) for row in rows):
        try:
            objects.read(name, size_bytes=1)
        except ObjectMissingError:
            raise ObjectRefusedError(
                f"{objects.where} is not the object store in which this store keeps its segments: see --objects"
            ) from None
    return bool(rows)
