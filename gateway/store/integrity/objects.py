"""Compares the object store with the ledger, and on request reads every byte.

Both change while they are looked at. So what looks wrong is looked at again, in an order in which an object that only
comes or goes is never taken for a lost one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import NamedTuple

from gateway.errors import CorruptObjectError, DamagedError, ObjectMissingError
from gateway.store.accounts.audit_heads import HEADS
from gateway.store.engine import StoreEngine, unsigned
from gateway.store.object_store_marker import MARK
from gateway.store.objects import ObjectStore, chunks
from gateway.store.telemetry.segments import open_chunk, unpack

__all__ = ["BadObject", "Ledger", "bad_objects", "orphans", "read_ledger", "unreadable"]

_RUNS = (
    "SELECT b.chunk_start, b.chunk_bytes, b.place, b.first_seq, b.count, b.first_ns, b.last_ns, b.size_bytes,"
    " b.stream_id, b.epoch, b.channel FROM segment_runs b JOIN segments s ON s.segment = b.segment"
    " WHERE s.object = ? ORDER BY b.chunk_start, b.place"
)


class Entry(NamedTuple):
    """A row of the ledger, and whether a segment, a recording or a bundle refers to it; the mark needs nobody."""

    kind: str
    state: str
    size_bytes: int
    sha256: str
    referred: bool


class BadObject(NamedTuple):
    """An object with which something is wrong, and what."""

    name: str
    what: str
    detail: str


Ledger = dict[str, Entry]


def read_ledger(engine: StoreEngine) -> Ledger:
    """The whole ledger, of one moment."""
    query = (
        "SELECT o.name, o.kind, o.state, o.size_bytes, o.sha256,"
        " s.object IS NOT NULL OR r.object IS NOT NULL OR u.object IS NOT NULL FROM objects o"
        " LEFT JOIN segments s ON s.object = o.name LEFT JOIN recordings r ON r.object = o.name"
        " LEFT JOIN update_bundles u ON u.object = o.name"
    )
    with engine.transaction(write=False):
        rows = engine.fetch(query)
    return {
        name: Entry(kind, state, size_bytes, sha256, _needs_nobody(kind, state) or bool(referred))
        for name, kind, state, size_bytes, sha256, referred in rows
    }


def bad_objects(engine: StoreEngine, objects: ObjectStore) -> Iterator[BadObject]:
    """Stored objects that are missing or of another size, and rows of the ledger that disagree with what refers."""
    ledger = read_ledger(engine)
    listed = {info.name: info.size_bytes for info in objects.names()}
    now: Ledger | None = None
    for name, entry in sorted(ledger.items()):
        if entry.state == "stored" and listed.get(name) == entry.size_bytes and entry.referred:
            continue
        if entry.state != "stored" and not entry.referred:
            continue
        now = read_ledger(engine) if now is None else now
        if now.get(name) == entry:
            yield from _bad(objects, name, entry)


def orphans(engine: StoreEngine, objects: ObjectStore) -> list[BadObject]:
    """Objects that the ledger does not know; one that is in use all the same is damage of the ledger."""
    listed = {info.name: info.size_bytes for info in objects.names()}
    ledger = read_ledger(engine)  # read later: it has every object that was there then, or has seen it go
    with engine.transaction(write=False):
        code = {str(row[0]) for row in engine.fetch("SELECT object FROM lambda_code")}  # functions' own ledger
    found = []
    for name in sorted(listed.keys() - ledger.keys() - code):
        try:
            objects.read(name, size_bytes=1)
        except DamagedError:
            continue  # it went meanwhile, as it should
        if _in_use(engine, name):
            found.append(BadObject(name, "ledger", "it is in use, and the ledger does not know it"))
        else:
            found.append(BadObject(name, "orphan", f"{listed[name]} bytes that the ledger does not know"))
    return found


def unreadable(engine: StoreEngine, objects: ObjectStore, name: str, entry: Entry) -> BadObject | None:
    """Read a stored object through: its checksum, and of a segment every run; None when all is well."""
    try:
        _check_sum(objects, name, entry)
        if entry.kind == "segment":
            _check_runs(engine, objects, name)
    except DamagedError as error:
        if read_ledger_entry(engine, name) != entry:
            return None  # deleted meanwhile
        what = "missing" if isinstance(error, ObjectMissingError) else "corrupt"
        return BadObject(name, what, str(error))
    return None


def read_ledger_entry(engine: StoreEngine, name: str) -> Entry | None:
    """One row of the ledger as it is now."""
    query = (
        "SELECT kind, state, size_bytes, sha256, EXISTS (SELECT 1 FROM segments WHERE object = ?)"
        " OR EXISTS (SELECT 1 FROM recordings WHERE object = ?)"
        " OR EXISTS (SELECT 1 FROM update_bundles WHERE object = ?) FROM objects WHERE name = ?"
    )
    with engine.transaction(write=False):
        rows = engine.fetch(query, name, name, name, name)
    for kind, state, size_bytes, sha256, referred in rows:
        return Entry(kind, state, size_bytes, sha256, _needs_nobody(kind, state) or bool(referred))
    return None


def _in_use(engine: StoreEngine, name: str) -> bool:
    tables = ("segments", "recordings", "update_bundles")
    used = " UNION ALL ".join(f"SELECT object FROM {table} WHERE object = ?" for table in tables)
    with engine.transaction(write=False):
        return bool(engine.fetch(used, *[name] * len(tables)))


def _needs_nobody(kind: str, state: str) -> bool:
    """Whether nothing has to refer to it: the mark that says whose objects these are, a head of the audit log."""
    return kind in (MARK, HEADS) and state == "stored"


def _bad(objects: ObjectStore, name: str, entry: Entry) -> Iterator[BadObject]:
    if entry.state != "stored":
        yield BadObject(name, "ledger", f"it is in use, and the ledger calls it {entry.state}")
        return
    if not entry.referred:
        yield BadObject(name, "unused", "it is stored, and nothing refers to it")
    try:
        whole = entry.size_bytes == 0 or objects.read(name, start=entry.size_bytes - 1, size_bytes=2)
    except ObjectMissingError:
        yield BadObject(name, "missing", "the object is not there")
        return
    if whole is not True and len(whole) != 1:
        yield BadObject(name, "size", f"it should have {entry.size_bytes} bytes")


def _check_sum(objects: ObjectStore, name: str, entry: Entry) -> None:
    digest, size_bytes = hashlib.sha256(), 0
    for piece in chunks(objects, name):
        digest.update(piece)
        size_bytes += len(piece)
    if size_bytes != entry.size_bytes:
        raise CorruptObjectError(f"it has {size_bytes} bytes, not {entry.size_bytes}")
    if digest.hexdigest() != entry.sha256:
        raise CorruptObjectError("its SHA-256 is another one than it was")


def _check_runs(engine: StoreEngine, objects: ObjectStore, name: str) -> None:
    with engine.transaction(write=False):
        rows = engine.fetch(_RUNS, name)
    place, records = (-1, -1), b""
    for row in rows:
        if place != (row[0], row[1]):
            place = (row[0], row[1])
            records = open_chunk(objects.read(name, start=row[0], size_bytes=row[1]))
        stamps, lengths, payload = unpack(records, offset=row[2], first_seq=row[3], count=row[4])
        found = (len(stamps), int(stamps.min()), int(stamps.max()), len(payload), int(lengths.sum()))
        if found != (row[4], row[5], row[6], row[7], row[7]):
            raise CorruptObjectError(f"numbers {row[3]} on of stream {row[8]}, epoch {unsigned(row[9]):016x} differ")
