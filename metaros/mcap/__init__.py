"""MCAP files as Meta-ROS writes them: bags of a recorder, segments of the gateway's history, clips of a black box."""

from __future__ import annotations

from metaros.mcap.file import COMPRESSIONS, McapFile

__all__ = ["COMPRESSIONS", "McapFile"]
