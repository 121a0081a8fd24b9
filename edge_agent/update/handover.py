"""What the loader tells the agent that it starts, and how the agent gives the process back to it."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass

from metaros.limits import LIMITS

__all__ = ["AGAIN", "LOADED", "Loaded", "give_back", "loaded"]

LOADED = "METAROS_AGENT_SLOT"  # in the environment of an agent that the loader started
AGAIN = 75  # the exit code of an agent that wants to be started anew by the loader that waits for it


@dataclass(frozen=True, slots=True, kw_only=True)
class Loaded:
    """How this agent was started."""

    loader: tuple[str, ...]  # its program and arguments
    watcher: int = 0  # the process id of the loader, where it stays and waits
    health_s: float = LIMITS.update_health_s
    link_s: float = LIMITS.update_link_s


def loaded(environ: Mapping[str, str] = os.environ) -> Loaded | None:
    """What the loader said; None for an agent that was started without it."""
    try:
        table = json.loads(environ[LOADED])
        return Loaded(
            loader=tuple(map(str, table["loader"])),
            watcher=int(table["watcher"]),
            health_s=float(table["health_s"]),
            link_s=float(table["link_s"]),
        )
    except (KeyError, ValueError, TypeError):
        return None


def give_back(found: Loaded) -> None:
    """End this program at once, so that the loader starts what `slots/current` now says. Returns never.

    Where the loader waits it is told by the exit code; else the process becomes the loader, with the same process id.
    """
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    if found.watcher != os.getppid() and sys.platform != "win32":
        with contextlib.suppress(OSError):
            os.execv(found.loader[0], list(found.loader))
    os._exit(AGAIN)
