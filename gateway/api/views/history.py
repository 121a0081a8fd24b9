"""Stored history as the API shows it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from gateway.api.views.robots import rfc3339
from gateway.store.telemetry.history import StoredTopic

__all__ = ["compact_time", "history_view"]


def history_view(topics: Sequence[StoredTopic], *, series: int) -> dict[str, Any]:
    """What is stored of a robot."""
    return {
        "topics": [
            {
                "topic": item.topic,
                "type": item.schema_name,
                "class": item.delivery,
                "samples": item.samples,
                "bytes": item.size_bytes,
                "first": rfc3339(item.first_ns),
                "last": rfc3339(item.last_ns),
            }
            for item in topics
        ],
        "series": series,
        "first": rfc3339(min(item.first_ns for item in topics)) if topics else None,
        "last": rfc3339(max(item.last_ns for item in topics)) if topics else None,
    }


def compact_time(wall_ns: int) -> str:
    """A time for a file's name, like 20261121T060000Z."""
    return datetime.fromtimestamp(wall_ns // 10**9, UTC).strftime("%Y%m%dT%H%M%SZ")
