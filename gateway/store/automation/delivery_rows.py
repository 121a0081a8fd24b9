"""A delivery as a row of its table, and back."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import orjson

from gateway.domain.automation.delivery import WAITING, Delivery, Policy, Put
from gateway.domain.fleet.command import new_command_id
from gateway.store.engine import Row, StoreEngine
from gateway.store.schema import ROW_BYTES
from metaros.errors import TooLargeError
from metaros.limits import Limits

__all__ = ["COLUMNS", "INSERT", "age_ns", "delivery_of", "new_row", "plan_anew", "row_bytes", "skip_locked"]

COLUMNS = (
    "delivery, kind, target, state, due_ns, expires_ns, born_ns, ended_ns, until_ns, holder, attempts, tries, losses,"
    " redrives, size_bytes, happening, robot, dedup, code, message, policy, context, payload"
)
INSERT = f"INSERT INTO deliveries ({COLUMNS}) VALUES ({', '.join('?' * 23)}) ON CONFLICT DO NOTHING"


def row_bytes(put: Put, context: bytes, limits: Limits) -> int:
    """What a delivery counts for in the queue; TooLargeError for one that is over its limit."""
    size_bytes = len(put.payload) + len(context)
    if size_bytes > limits.delivery_bytes:
        raise TooLargeError(
            f"a delivery to {put.target} has {size_bytes} B, and {limits.delivery_bytes} B may: delivery_bytes"
        )
    return size_bytes + ROW_BYTES


def new_row(put: Put, place: int, *, now_ns: int, limits: Limits) -> tuple[Any, ...]:
    """The row of what is accepted now, so many places (below zero) before the end of those accepted together.

    What is due at once is due in the order in which it was put.
    """
    context = orjson.dumps(dict(put.context))
    return (
        new_command_id(now_ns),
        put.kind,
        put.target,
        WAITING,
        put.due_ns or now_ns + place,
        max(now_ns, put.due_ns) + age_ns(_policy_text(put.policy), limits),
        now_ns,
        0,
        0,
        "",
        0,
        0,
        0,
        0,
        row_bytes(put, context, limits),
        put.event_id,
        put.robot,
        put.dedup,
        "",
        "",
        _policy_text(put.policy),
        context.decode(),
        put.payload,
    )


def delivery_of(row: Row) -> Delivery:
    """The delivery of a row of COLUMNS."""
    put = Put(
        kind=row[1],
        target=row[2],
        payload=bytes(row[22]),
        event_id=row[15],
        robot=row[16],
        dedup=row[17],
        due_ns=row[4],
        context=orjson.loads(row[21]),
        policy=_policy(row[20]),
    )
    return Delivery(
        id=row[0],
        put=put,
        state=row[3],
        due_ns=row[4],
        expires_ns=row[5],
        born_ns=row[6],
        ended_ns=row[7],
        attempts=row[10],
        tries=row[11],
        losses=row[12],
        redrives=row[13],
        code=row[18],
        message=row[19],
    )


def age_ns(policy: str, limits: Limits) -> int:
    """How old a delivery of that policy (its column) may get."""
    return round(min(_policy(policy).most_age_s, limits.delivery_s) * 1e9)


def plan_anew(engine: StoreEngine) -> None:
    """Plan this transaction's statements by what the table holds now.

    PostgreSQL keeps a statement's plan: one from when the table was nearly empty looks through all of a backlog.
    """
    if engine.shared:
        engine.execute("SET LOCAL plan_cache_mode = force_custom_plan")


def skip_locked(engine: StoreEngine) -> str:
    """Ends a SELECT of rows that nobody else is changing now."""
    return f"{engine.for_update} SKIP LOCKED" if engine.for_update else ""


@functools.lru_cache(maxsize=256)
def _policy_text(policy: Policy) -> str:
    values: Sequence[Any] = (
        policy.most_attempts,
        policy.most_age_s,
        policy.backoff,
        policy.first_s,
        policy.most_s,
    )
    return orjson.dumps(values).decode()


@functools.lru_cache(maxsize=256)
def _policy(text: str) -> Policy:
    most_attempts, most_age_s, backoff, first_s, most_s = orjson.loads(text)
    return Policy(most_attempts=most_attempts, most_age_s=most_age_s, backoff=backoff, first_s=first_s, most_s=most_s)
