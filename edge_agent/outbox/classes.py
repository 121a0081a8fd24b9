"""The delivery classes' durable part as a table: quota, when a batch is synced, and who yields when space is short."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from metaros.limits import LIMITS
from metaros.link import BACKFILL_BIT

__all__ = ["BACKFILL_BIT", "CLASSES", "LOGS", "ClassPolicy", "LogName", "log_name"]

Class = Literal["event", "metric", "bulk"]
LogName = str

# Each class has one log; metrics and bulk a second for what piles up while the link is down, so that fresh samples
# need not wait behind it. Events stay one queue: their order tells a story.
LOGS: tuple[LogName, ...] = ("event", "metric", "bulk", "metric_backfill", "bulk_backfill")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassPolicy:
    """One class: `sync_s` and `sync_bytes` say when what was gathered is written and synced."""

    quota_bytes: int
    when_full: Literal["refuse", "thin", "drop"]
    sync_s: float
    sync_bytes: int
    floor_share: float = 0.0  # nothing is accepted below this free share of the disk,
    floor_bytes: int = 0  # or below so many bytes, whichever is less


CLASSES: Mapping[str, ClassPolicy] = {
    "event": ClassPolicy(
        quota_bytes=LIMITS.outbox_event_bytes, when_full="refuse", sync_s=0.005, sync_bytes=256 * 1024
    ),
    "metric": ClassPolicy(
        quota_bytes=LIMITS.outbox_metric_bytes,
        when_full="thin",
        sync_s=0.05,
        sync_bytes=64 * 1024,
        floor_share=0.05,
        floor_bytes=256 * 1024 * 1024,
    ),
    "bulk": ClassPolicy(
        quota_bytes=LIMITS.outbox_bulk_bytes,
        when_full="drop",
        sync_s=0.05,
        sync_bytes=1024 * 1024,
        floor_share=0.10,
        floor_bytes=512 * 1024 * 1024,
    ),
}


def log_name(delivery: str, *, backfill: bool) -> LogName:
    """The log of a class: events have no second one."""
    return f"{delivery}_backfill" if backfill and delivery != "event" else delivery
