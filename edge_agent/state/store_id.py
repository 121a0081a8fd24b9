"""Which store the robot's samples belong to: kept, so that another gateway is refused even after a restart."""

from __future__ import annotations

import logging

from edge_agent.errors import DiskError
from edge_agent.outbox import Disk

__all__ = ["StoreId"]

LOG = logging.getLogger("metaros.agent.uplink")
_NAME = "store_id"


class StoreId:
    """The id that the first gateway gave; empty until then."""

    def __init__(self, disk: Disk) -> None:
        """Raises DiskError."""
        self._disk = disk
        size = disk.size(_NAME)
        self.value = disk.read(_NAME, 0, min(size, 256)).decode(errors="replace").strip() if size else ""
        self._kept = self.value

    def learn(self, store_id: str) -> None:
        """A gateway was accepted. Where the disk refuses, only this process knows it, until the next session."""
        self.value = store_id
        if store_id == self._kept:
            return
        try:
            self._disk.replace(_NAME, store_id.encode())
            self._kept = store_id
        except DiskError as error:
            LOG.warning("cannot keep which store is ours: %s", error)
