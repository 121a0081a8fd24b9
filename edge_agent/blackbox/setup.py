"""Opens what the black box keeps in the agent's state directory; an agent whose disk refuses that goes on without."""

from __future__ import annotations

import logging
from pathlib import Path

from edge_agent.blackbox.box import BlackBox
from edge_agent.blackbox.memory import memory_folder
from edge_agent.blackbox.recording_store import RecordingStore
from edge_agent.blackbox.ring import Ring
from edge_agent.config.black_box import BlackBoxSettings
from edge_agent.errors import DiskError
from edge_agent.forwarding.sealing import Sealing
from edge_agent.outbox import Disk, OsDisk
from metaros.clock import Clock

__all__ = ["BOX_FOLDER", "RECORDINGS_FOLDER", "open_box", "open_recordings"]

LOG = logging.getLogger("metaros.agent.black_box")
BOX_FOLDER, RECORDINGS_FOLDER = "black_box", "recordings"


def open_box(
    settings: BlackBoxSettings, directory: Path, disk: Disk, clock: Clock, *, sealing: Sealing | None = None
) -> BlackBox | None:
    """The black box of a state directory, begun; None where it is switched off. `sealing` is its own alone."""
    if not settings.enabled:
        return None

    folder = directory / BOX_FOLDER

    def open_ring() -> Ring:
        memory = memory_folder(folder) if settings.keep == "memory" else None
        return Ring(
            memory or folder,
            clock,
            window_s=settings.minutes * 60,
            limit_bytes=settings.quota_bytes if memory is None else min(settings.memory_bytes, settings.quota_bytes),
            free=disk.free if memory is None else OsDisk(memory).free,
            seal=sealing.recorded if sealing is not None else None,
            disk=folder,
        )

    box = BlackBox(settings, open_ring, clock)
    box.start()
    return box


def open_recordings(directory: Path) -> RecordingStore | None:
    """The store of finished recordings, also of a black box that is off by now."""
    try:
        return RecordingStore(directory / RECORDINGS_FOLDER)
    except DiskError as error:
        LOG.warning("no recording can be kept: %s", error)
        return None
