"""The proof of an audit log as one document, from its rows and its exported heads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gateway.errors import GatewayError
from gateway.store.accounts.audit import AuditFault, AuditHead, verify_rows
from gateway.store.accounts.audit_heads import HeadReport, Seal, check_heads
from gateway.store.engine import StoreEngine
from gateway.store.objects import ObjectStore
from metaros.limits import LIMITS

__all__ = ["MAX_FAULTS", "STEP_ROWS", "proof", "prove"]

MAX_FAULTS = 100
STEP_ROWS = 2000


def prove(engine: StoreEngine, objects: ObjectStore, *, seal: Seal | None = None) -> dict[str, Any]:
    """Prove every row and compare the exported heads, in this thread."""
    at, more = AuditHead(0, ""), True
    faults: list[AuditFault] = []
    while more:
        at, found, more = verify_rows(engine, at, limit=STEP_ROWS)
        faults += found[: MAX_FAULTS - len(faults)]
    try:
        heads = check_heads(engine, objects, limit=LIMITS.audit_heads, seal=seal)
    except GatewayError as error:
        return proof(at, faults, None, error=str(error))
    return proof(at, faults, heads)


def proof(at: AuditHead, faults: Sequence[AuditFault], heads: HeadReport | None, *, error: str = "") -> dict[str, Any]:
    """{ok, rows, hash, faults, heads, heads_sealed, heads_error}; `error` says why the heads could not be read."""
    named = [*faults, *(heads.faults if heads is not None else [])][:MAX_FAULTS]
    return {
        "ok": not named and not error,
        "rows": at.number,
        "hash": at.hash,
        "faults": [fault._asdict() for fault in named],
        "heads": heads.checked if heads is not None else 0,
        "heads_sealed": heads.sealed if heads is not None else 0,
        "heads_error": error,
    }
