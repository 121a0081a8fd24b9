"""Deleting what of the queue is kept long enough, the oldest first, a slice at a time. Inside a transaction of the
caller's.
"""

from __future__ import annotations

from dataclasses import dataclass

from gateway.domain.automation.delivery import Share
from gateway.store.automation.delivery_rows import skip_locked
from gateway.store.automation.queue_totals import DEAD_ROWS, DONE_ROWS, GATEWAY_EVENTS, count, totals
from gateway.store.engine import StoreEngine
from metaros.limits import LIMITS, Limits

__all__ = ["purge_queue"]

NO_BOUND = 1 << 62


@dataclass(frozen=True, slots=True)
class _Retention:
    """Something that is kept for a while: where, and its bounds."""

    what: str
    table: str
    key: str
    time: str
    condition: str
    kept_s: float
    most: Share


def purge_queue(engine: StoreEngine, *, gateway: str, now_ns: int, limits: Limits = LIMITS, limit: int = 1000) -> int:
    """Delete of each kind at most `limit` that are too old or too many; how many went (0: all is within its bounds)."""
    held = totals(engine)
    shares = {DONE_ROWS: held.done, DEAD_ROWS: held.dead, GATEWAY_EVENTS: held.gateway_events}
    gone = sum(
        _purge(engine, retention, shares[retention.what], gateway, now_ns, limit) for retention in _retentions(limits)
    )
    return gone + engine.execute(
        "DELETE FROM replays WHERE replay IN"
        " (SELECT replay FROM replays WHERE ended_ns > 0 ORDER BY made_ns DESC, replay LIMIT ? OFFSET ?)",
        limit,
        limits.replays_kept,
    )


def _retentions(limits: Limits) -> tuple[_Retention, ...]:
    done, dead = ("deliveries", "delivery", "ended_ns", "state = 'done'"), "state = 'dead'"
    return (
        _Retention(DONE_ROWS, *done, limits.dedup_s, Share(limits.deduped, NO_BOUND)),
        _Retention(
            DEAD_ROWS, *done[:3], dead, limits.dead_letters_s, Share(limits.dead_letters, limits.dead_letters_bytes)
        ),
        _Retention(
            GATEWAY_EVENTS,
            *("happenings", "happening", "stored_ns", "1 = 1"),
            limits.happenings_s,
            Share(limits.happenings_kept, limits.happenings_bytes),
        ),
    )


def _purge(engine: StoreEngine, retention: _Retention, held: Share, gateway: str, now_ns: int, limit: int) -> int:
    sql = (
        f"SELECT {retention.key}, {retention.time}, size_bytes FROM {retention.table} WHERE {retention.condition}"
        f" ORDER BY {retention.time} LIMIT ?{skip_locked(engine)}"
    )
    before_ns = now_ns - round(retention.kept_s * 1e9)
    rows, left_bytes = held.rows, held.size_bytes
    going: list[tuple[object]] = []
    for key, time_ns, size_bytes in engine.fetch(sql, limit):
        if time_ns >= before_ns and rows <= retention.most.rows and left_bytes <= retention.most.size_bytes:
            break
        going.append((key,))
        rows, left_bytes = rows - 1, left_bytes - int(size_bytes)
    engine.many(f"DELETE FROM {retention.table} WHERE {retention.key} = ?", going)
    count(engine, gateway, retention.what, rows - held.rows, left_bytes - held.size_bytes)
    return len(going)
