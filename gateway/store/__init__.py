"""What survives a restart: robots, watermarks, gaps and numeric series in one SQLite file."""

from __future__ import annotations

from gateway.store.store import Store
from gateway.store.writes import RobotWrite, StreamWrite, Write, WriterWrite

__all__ = ["RobotWrite", "Store", "StreamWrite", "Write", "WriterWrite"]
