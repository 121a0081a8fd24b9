"""Update files in the database: keys of the online roles, signed documents, bundles, and whose turn a duty is.

Every function runs inside a transaction of the caller's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import orjson

from gateway.store import ledger
from gateway.store.engine import Row, StoreEngine

__all__ = [
    "StoredBundle",
    "StoredDocument",
    "StoredKey",
    "add_bundle",
    "add_document",
    "add_key",
    "bundle_at",
    "fetch_secret",
    "give_duties",
    "list_bundles",
    "list_keys",
    "lock_updates",
    "newest_documents",
    "next_version",
    "raise_versions",
    "read_document",
    "take_duty",
    "trim_documents",
    "withdraw_bundle",
]

FETCH_SECRET = "updates_fetch_secret"
VERSION_FLOOR = "updates_version_floor"
_BUNDLE = (
    "path, kind, name, version, sha256, size_bytes, manifest, object, uploaded_ns, uploaded_by, withdrawn_ns, reason"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredKey:
    """An online role's key: its public half as JSON, its private one sealed."""

    keyid: str
    role: str
    public_key: str
    sealed: bytes
    made_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredDocument:
    """A signed document as it is served."""

    role: str
    version: int
    document: bytes
    expires_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredBundle:
    """An uploaded bundle; `withdrawn_ns` is 0 while robots may fetch it."""

    path: str
    kind: str
    name: str
    version: str
    sha256: str
    size_bytes: int
    manifest: dict[str, Any]
    object: str
    uploaded_ns: int
    uploaded_by: str
    withdrawn_ns: int = 0
    reason: str = ""


def lock_updates(engine: StoreEngine) -> None:
    """Others who change signed documents wait until this transaction is over."""
    engine.execute("INSERT INTO duties VALUES ('updates.lock', '', 0) ON CONFLICT (duty) DO NOTHING")
    engine.execute("UPDATE duties SET until_ns = until_ns + 1 WHERE duty = 'updates.lock'")


def take_duty(engine: StoreEngine, duty: str, holder: str, *, now_ns: int, for_ns: int) -> bool:
    """Whether it is this holder's turn now, and then until `for_ns` from now: free, run out, or its own already."""
    engine.execute("INSERT INTO duties VALUES (?, '', 0) ON CONFLICT (duty) DO NOTHING", duty)
    taken = engine.execute(
        "UPDATE duties SET holder = ?, until_ns = ? WHERE duty = ? AND (holder = ? OR until_ns <= ?)",
        holder,
        now_ns + for_ns,
        duty,
        holder,
        now_ns,
    )
    return bool(taken)


def give_duties(engine: StoreEngine, holder: str) -> None:
    """Whatever is this holder's turn is anybody's from now on."""
    engine.execute("UPDATE duties SET until_ns = 0 WHERE holder = ?", holder)


def fetch_secret(engine: StoreEngine, fresh: str) -> str:
    """The store's secret behind robots' tokens: `fresh` where there was none."""
    engine.execute("INSERT INTO meta VALUES (?, ?) ON CONFLICT (key) DO NOTHING", FETCH_SECRET, fresh)
    return str(engine.fetch("SELECT value FROM meta WHERE key = ?", FETCH_SECRET)[0][0])


def list_keys(engine: StoreEngine) -> list[StoredKey]:
    """Every key of the online roles, the newest first."""
    rows = engine.fetch("SELECT keyid, role, public_key, sealed, made_ns FROM update_keys ORDER BY made_ns DESC, keyid")
    return [
        StoredKey(keyid=row[0], role=row[1], public_key=row[2], sealed=bytes(row[3]), made_ns=row[4]) for row in rows
    ]


def add_key(engine: StoreEngine, key: StoredKey) -> None:
    """Keep another key."""
    values = (key.keyid, key.role, key.public_key, key.sealed, key.made_ns)
    engine.execute("INSERT INTO update_keys VALUES (?, ?, ?, ?, ?)", *values)


def add_document(engine: StoreEngine, one: StoredDocument, *, now_ns: int) -> None:
    """Keep a signed document; its version must be new."""
    values = (one.role, one.version, one.document, one.expires_ns, now_ns)
    engine.execute("INSERT INTO update_metadata VALUES (?, ?, ?, ?, ?)", *values)


def read_document(engine: StoreEngine, role: str, version: int | None = None) -> StoredDocument | None:
    """One version, or the newest."""
    sql = "SELECT role, version, document, expires_ns FROM update_metadata WHERE role = ?"
    if version is None:
        rows = engine.fetch(f"{sql} ORDER BY version DESC LIMIT 1", role)
    else:
        rows = engine.fetch(f"{sql} AND version = ?", role, version)
    return _document(rows[0]) if rows else None


def newest_documents(engine: StoreEngine) -> dict[str, StoredDocument]:
    """The newest document of every role that has one."""
    rows = engine.fetch(
        "SELECT m.role, m.version, m.document, m.expires_ns FROM update_metadata m WHERE m.version ="
        " (SELECT MAX(n.version) FROM update_metadata n WHERE n.role = m.role) ORDER BY m.role"
    )
    return {row[0]: _document(row) for row in rows}


def next_version(engine: StoreEngine, newest: StoredDocument | None) -> int:
    """The version of what the gateway signs next: above the newest one, and above what was before a restore."""
    rows = engine.fetch("SELECT value FROM meta WHERE key = ?", VERSION_FLOOR)
    return max(newest.version if newest is not None else 0, int(rows[0][0]) if rows else 0) + 1


def raise_versions(engine: StoreEngine, roles: Sequence[str], *, floor: int, now_ns: int) -> None:
    """The store was restored: robots have seen newer versions than it has, and refuse to go back.

    What the gateway signs itself is due again at once, under versions above `floor`.
    """
    put = "INSERT INTO meta VALUES (?, ?) ON CONFLICT (key) DO UPDATE SET value = excluded.value"
    engine.execute(put, VERSION_FLOOR, str(floor))
    engine.many("UPDATE update_metadata SET expires_ns = ? WHERE role = ?", [(now_ns, role) for role in roles])


def trim_documents(engine: StoreEngine, role: str, *, keep: int) -> None:
    """Delete all but the newest `keep` versions: robots ask for the newest ones only, except of the root."""
    newest = "SELECT MAX(version) FROM update_metadata WHERE role = ?"
    engine.execute(f"DELETE FROM update_metadata WHERE role = ? AND version <= ({newest}) - ?", role, role, keep)


def add_bundle(engine: StoreEngine, bundle: StoredBundle, *, now_ns: int) -> None:
    """Its upload is complete: from now on the row refers to the object."""
    engine.execute(
        f"INSERT INTO update_bundles ({_BUNDLE}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        bundle.path,
        bundle.kind,
        bundle.name,
        bundle.version,
        bundle.sha256,
        bundle.size_bytes,
        orjson.dumps(bundle.manifest).decode(),
        bundle.object,
        bundle.uploaded_ns,
        bundle.uploaded_by,
        bundle.withdrawn_ns,
        bundle.reason,
    )
    ledger.stored(engine, bundle.object, size_bytes=bundle.size_bytes, sha256=bundle.sha256, now_ns=now_ns)


def bundle_at(engine: StoreEngine, path: str) -> StoredBundle | None:
    """The bundle of a target path."""
    rows = engine.fetch(f"SELECT {_BUNDLE} FROM update_bundles WHERE path = ?", path)
    return _bundle(rows[0]) if rows else None


def list_bundles(engine: StoreEngine, *, limit: int) -> list[StoredBundle]:
    """Every bundle, the newest first."""
    sql = f"SELECT {_BUNDLE} FROM update_bundles ORDER BY uploaded_ns DESC, path LIMIT ?"
    return [_bundle(row) for row in engine.fetch(sql, limit)]


def withdraw_bundle(engine: StoreEngine, path: str, reason: str, *, now_ns: int) -> bool:
    """Robots may not fetch it any more; False when there is none, or it was withdrawn before."""
    update = "UPDATE update_bundles SET withdrawn_ns = ?, reason = ? WHERE path = ? AND withdrawn_ns = 0"
    return bool(engine.execute(update, now_ns, reason, path))


def _document(row: Row) -> StoredDocument:
    return StoredDocument(role=row[0], version=row[1], document=bytes(row[2]), expires_ns=row[3])


def _bundle(row: Row) -> StoredBundle:
    return StoredBundle(
        path=row[0],
        kind=row[1],
        name=row[2],
        version=row[3],
        sha256=row[4],
        size_bytes=row[5],
        manifest=orjson.loads(row[6]),
        object=row[7],
        uploaded_ns=row[8],
        uploaded_by=row[9],
        withdrawn_ns=row[10],
        reason=row[11],
    )
