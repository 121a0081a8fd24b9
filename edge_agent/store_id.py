"""Which store the robot's samples belong to: kept, so that another gateway is refused even after a restart."""

from __future__ import annotations

from edge_agent.outbox import Disk

__all__ = ["StoreId"]

_NAME = "store_id"


class StoreId:
    """The id that the first gateway gave; empty until then."""

    def __init__(self, disk: Disk) -> None:
        """Raises DiskError."""
        self._disk = disk
        size = disk.size(_NAME)
        self.value = disk.read(_NAME, 0, min(size, 256)).decode(errors="replace").strip() if size else ""

    def learn(self, store_id: str) -> None:
        """A gateway was accepted. Raises DiskError."""
        if store_id != self.value:
            self._disk.replace(_NAME, store_id.encode())
            self.value = store_id
