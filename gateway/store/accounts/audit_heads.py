"""Heads of the audit log in the object store: what the chain was at an earlier time, out of the database's reach.

Who can write to the database could write a whole new chain. It would differ from the heads that were exported before;
and a head that was sealed with the gateway's master key cannot be made by who has only the two stores.
"""

from __future__ import annotations

import base64
import hashlib
import io
import re
import secrets
from dataclasses import dataclass, field
from typing import Protocol

import orjson

from gateway.errors import DamagedError
from gateway.store.accounts.audit import AuditFault, AuditHead, read_hashes, read_head
from gateway.store.engine import StoreEngine
from gateway.store.ledger import Transact, announce, stored
from gateway.store.objects import ObjectStore

__all__ = ["HEADS", "HeadReport", "Seal", "check_heads", "export_head", "head_names"]

HEADS = "audit"  # the kind of these objects in the ledger, and the folder they lie in
HEAD_BYTES = 4096
_PURPOSE = "audit head"
_NAME = re.compile(rf"{HEADS}/(\d{{15}})-[0-9a-f]{{16}}")


class Seal(Protocol):
    """What seals a head: the gateway's master key."""

    def seal(self, purpose: str, secret_id: str, plain: bytes) -> bytes:
        """Sealed bytes."""

    def open(self, purpose: str, secret_id: str, sealed: bytes) -> bytes:
        """The plain ones; DamagedError when another key sealed them, or they have changed."""


@dataclass(slots=True)
class HeadReport:
    """How many exported heads were compared, how many of them this gateway's key sealed, and which do not hold."""

    checked: int = 0
    sealed: int = 0
    faults: list[AuditFault] = field(default_factory=list)


def export_head(
    engine: StoreEngine, run: Transact, objects: ObjectStore, *, gateway: str, now_ns: int, seal: Seal | None = None
) -> AuditHead | None:
    """Put the head into the object store; None when it is there already, or there is no row yet. `engine` reads.

    Raises:
        StoreError, ObjectStoreError: it cannot be done now.
    """
    head = read_head(engine)
    prefix = f"{HEADS}/{head.number:015d}-"
    if not head.number or any(True for _ in objects.names(prefix)):
        return None
    with engine.transaction(write=False):
        store = str(engine.fetch("SELECT value FROM meta WHERE key = 'store_id'")[0][0])
    name = prefix + secrets.token_hex(8)
    facts = {"store": store, "number": head.number, "hash": head.hash, "at_ns": now_ns, "gateway": gateway}
    sealed = seal.seal(_PURPOSE, name, orjson.dumps(facts)) if seal is not None else b""
    data = orjson.dumps({**facts, "seal": base64.b64encode(sealed).decode()})
    sha256 = hashlib.sha256(data).hexdigest()
    run(lambda writing: announce(writing, name, kind=HEADS, now_ns=now_ns))
    objects.put(name, io.BytesIO(data), size_bytes=len(data), sha256=sha256)
    run(lambda writing: stored(writing, name, size_bytes=len(data), sha256=sha256, now_ns=now_ns))
    return head


def head_names(objects: ObjectStore, *, limit: int) -> list[str]:
    """The exported heads with the highest numbers, the lowest of them first."""
    return sorted(info.name for info in objects.names(f"{HEADS}/") if _NAME.fullmatch(info.name))[-limit:]


def check_heads(engine: StoreEngine, objects: ObjectStore, *, limit: int, seal: Seal | None = None) -> HeadReport:
    """Compare the newest exported heads with the chain; ObjectStoreError when they cannot be read now."""
    report = HeadReport()
    said: dict[str, AuditHead] = {}
    for name in head_names(objects, limit=limit):
        number = int(name[len(HEADS) + 1 :].partition("-")[0])
        report.checked += 1
        try:
            facts, sealed = _facts(objects.read(name, size_bytes=HEAD_BYTES), name, seal)
        except (DamagedError, ValueError, KeyError, TypeError) as error:
            report.faults.append(AuditFault(number, "export", f"{name} is not what was exported: {error}"[:300]))
            continue
        report.sealed += sealed
        said[name] = facts
    hashes = read_hashes(engine, sorted({head.number for head in said.values()}))
    for name, head in said.items():
        if hashes.get(head.number) != head.hash:
            detail = "is not there" if head.number not in hashes else "is another one than was exported"
            report.faults.append(AuditFault(head.number, "export", f"the row {detail} ({name})"))
    return report


def _facts(data: bytes, name: str, seal: Seal | None) -> tuple[AuditHead, bool]:
    """What an exported head says, and whether `seal` has sealed it; one that another key sealed says it unproven."""
    document = orjson.loads(data)
    head = AuditHead(int(document["number"]), str(document["hash"]))
    if not name.startswith(f"{HEADS}/{head.number:015d}-"):
        raise ValueError("its name is of another row")
    try:
        plain = seal.open(_PURPOSE, name, base64.b64decode(document["seal"])) if seal is not None else b""
    except DamagedError:
        plain = b""
    if not plain:
        return head, False
    proven = orjson.loads(plain)
    if AuditHead(proven["number"], proven["hash"]) != head:
        raise ValueError("it says another thing than was sealed")
    return head, True
