"""Idempotency keys in the database, with what was made under each. Each function runs in a transaction of the caller's.

What commands are kept under is theirs, see `store/commands.py`.
"""

from __future__ import annotations

from gateway.domain.errors import IdempotencyConflictError
from gateway.domain.idempotency import IdempotentRequest
from gateway.store.engine import StoreEngine
from metaros.limits import LIMITS

__all__ = ["made_before", "remember_made"]


def made_before(engine: StoreEngine, once: IdempotentRequest | None) -> str:
    """The id of what the same request made before; "" when it is new, or has no key.

    Raises:
        IdempotencyConflictError: the key was used for another request.
    """
    if once is None:
        return ""
    sql = "SELECT digest, made FROM made_once WHERE issuer = ? AND idempotency = ?"
    rows = engine.fetch(sql, once.issuer, once.key)
    if not rows:
        return ""
    digest, made = rows[0]
    if digest != once.digest:
        raise IdempotencyConflictError("this Idempotency-Key was used for another request: take a new one")
    return str(made)


def remember_made(engine: StoreEngine, once: IdempotentRequest | None, made: str, *, now_ns: int) -> None:
    """Keep what a request made, in the transaction that makes it; what is a day old is forgotten.

    Raises:
        IdempotencyConflictError: another gateway was faster.
    """
    if once is None:
        return
    engine.execute("DELETE FROM made_once WHERE made_ns < ?", now_ns - round(LIMITS.made_once_s * 1e9))
    sql = "INSERT INTO made_once VALUES (?, ?, ?, ?, ?) ON CONFLICT (issuer, idempotency) DO NOTHING"
    if not engine.execute(sql, once.issuer, once.key, once.digest, made, now_ns):
        raise IdempotencyConflictError("a request under this Idempotency-Key is under way: send it again")
