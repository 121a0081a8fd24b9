"""The persistent store: robots, watermarks, gaps, messages and numeric series, in SQLite or PostgreSQL."""

from __future__ import annotations

from gateway.store.store import Store
from gateway.store.telemetry.samples import SampleFilter, StoredBatch
from gateway.store.writes import Committed, Mark, RobotWrite, StreamWrite, Write, WriterWrite

__all__ = [
    "Committed",
    "Mark",
    "RobotWrite",
    "SampleFilter",
    "Store",
    "StoredBatch",
    "StreamWrite",
    "Write",
    "WriterWrite",
]
