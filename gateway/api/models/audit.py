"""The audit log's documents, as models."""

from __future__ import annotations

from typing import Literal

from gateway.api.models.base import Exact

__all__ = ["AuditPage", "AuditProof", "AuditRow"]


class AuditRow(Exact):
    """A row of the log; `hash` proves it and all before it."""

    number: int
    at: str
    gateway: str
    kind: str
    actor: str
    name: str
    role: str
    address: str
    action: str
    method: str
    target: str
    status: int
    code: str
    detail: str
    hash: str


class AuditPage(Exact):
    """Rows, the newest first; `next` is `before` of the page after this one, null at the end."""

    rows: list[AuditRow]
    next: int | None


class AuditFault(Exact):
    """What does not hold, at which row."""

    number: int
    fault: Literal["hash", "missing", "head", "export"]
    detail: str


class AuditProof(Exact):
    """Whether every row follows from the one before, and the exported heads are those of this chain.

    At most 100 faults. `heads` were compared; `heads_sealed` of them were sealed with this gateway's master key.
    """

    ok: bool
    rows: int
    hash: str
    faults: list[AuditFault]
    heads: int
    heads_sealed: int
    heads_error: str
