"""What the queue holds, counted as it changes. Every function runs inside a transaction of the caller's.

Each gateway has rows of its own, whose sum is what there is: gateways of one database never wait for each other's
count, and one that ends what another had put may well stand below zero.
"""

from __future__ import annotations

from gateway.domain.automation.delivery import Share, Totals
from gateway.domain.errors import QueueFullError
from gateway.store.engine import StoreEngine
from metaros.limits import Limits

__all__ = ["DEAD_ROWS", "DONE_ROWS", "GATEWAY_EVENTS", "LIVE", "check_room", "count", "totals"]

LIVE, DEAD_ROWS, DONE_ROWS, GATEWAY_EVENTS = "live", "dead", "done", "happenings"

_COUNT = """
    INSERT INTO queue_totals VALUES (?, ?, ?, ?) ON CONFLICT (gateway, what) DO UPDATE SET
        count = queue_totals.count + excluded.count, size_bytes = queue_totals.size_bytes + excluded.size_bytes
"""
_SUM = """
    SELECT what, CAST(sum(count) AS BIGINT), CAST(sum(size_bytes) AS BIGINT) FROM queue_totals GROUP BY what
"""


def count(engine: StoreEngine, gateway: str, what: str, rows: int, size_bytes: int) -> None:
    """So many rows and bytes came, or (below zero) went."""
    if rows or size_bytes:
        engine.execute(_COUNT, gateway, what, rows, size_bytes)


def totals(engine: StoreEngine) -> Totals:
    """What there is."""
    found = {what: Share(int(rows), int(size_bytes)) for what, rows, size_bytes in engine.fetch(_SUM)}
    none = Share()
    return Totals(
        live=found.get(LIVE, none),
        dead=found.get(DEAD_ROWS, none),
        done=found.get(DONE_ROWS, none),
        gateway_events=found.get(GATEWAY_EVENTS, none),
    )


def check_room(live: Share, more: Share, limits: Limits) -> None:
    """QueueFullError where more than there is room for would wait."""
    if live.rows + more.rows > limits.queue_rows:
        raise QueueFullError(f"{live.rows} deliveries wait, and {limits.queue_rows} may: queue_rows")
    if live.size_bytes + more.size_bytes > limits.queue_bytes:
        raise QueueFullError(f"deliveries of {live.size_bytes} B wait, and {limits.queue_bytes} B may: queue_bytes")
