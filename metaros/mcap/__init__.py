"""MCAP files as this project writes them: recordings of a robot, its black box, segments of a history, exports."""

from __future__ import annotations

from metaros.mcap.chunk import MalformedChunkError, read_chunk, read_messages
from metaros.mcap.file import COMPRESSIONS, FAST, SMALL, McapFile

__all__ = [
    "COMPRESSIONS",
    "FAST",
    "SMALL",
    "MalformedChunkError",
    "McapFile",
    "read_chunk",
    "read_messages",
]
