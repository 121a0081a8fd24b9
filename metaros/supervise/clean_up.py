"""What takes away what a program leaves beside its process group, such as a container."""

from __future__ import annotations

import asyncio
import logging
import subprocess

from metaros.supervise.orphan_reaper_main import LAST_S

__all__ = ["clean_up"]

LOG = logging.getLogger("metaros.supervisor")


async def clean_up(argv: tuple[str, ...]) -> None:
    """Run it to its end, which may say that there was nothing. It goes on where the caller is cancelled."""
    await asyncio.shield(asyncio.to_thread(_run, argv))


def _run(argv: tuple[str, ...]) -> None:
    nothing = subprocess.DEVNULL
    try:
        subprocess.run(argv, stdin=nothing, stdout=nothing, stderr=nothing, timeout=LAST_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        LOG.warning("%s: %s", argv[0], error)
