"""How the loader starts the agent, and how the agent hands the process back to the loader for a restart."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass

from metaros.limits import LIMITS

__all__ = [
    "LOADER_ENV",
    "RESTART",
    "RESTART_EXIT_CODE",
    "LoaderInfo",
    "RestartRequest",
    "exit_to_loader",
    "loader_info",
]

LOADER_ENV = "METAROS_AGENT_SLOT"  # in the environment of an agent that the loader started
RESTART_EXIT_CODE = 75  # the exit code of an agent that wants to be started anew by the loader that waits for it
CLOSE_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LoaderInfo:
    """How this agent was started."""

    loader: tuple[str, ...]  # its program and arguments
    watcher: int = 0  # the process id of the loader, where it stays and waits
    health_s: float = LIMITS.update_health_s
    link_s: float = LIMITS.update_link_s


def loader_info(environ: Mapping[str, str] = os.environ) -> LoaderInfo | None:
    """The loader's environment variable, parsed; None for an agent that was started without a loader."""
    try:
        table = json.loads(environ[LOADER_ENV])
        return LoaderInfo(
            loader=tuple(map(str, table["loader"])),
            watcher=int(table["watcher"]),
            health_s=float(table["health_s"]),
            link_s=float(table["link_s"]),
        )
    except (KeyError, ValueError, TypeError):
        return None


def exit_to_loader(found: LoaderInfo) -> None:
    """End this program at once, so that the loader starts what `slots/current` now says. Returns never.

    Where the loader waits it sees the exit code; else the process becomes the loader, with the same process id.
    """
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    if found.watcher != os.getppid() and sys.platform != "win32":
        with contextlib.suppress(OSError):
            os.execv(found.loader[0], list(found.loader))
    os._exit(RESTART_EXIT_CODE)


class RestartRequest:
    """Whether this program is to become another version once everything of it is closed."""

    def __init__(self, *, patience_s: float = CLOSE_S) -> None:
        """`patience_s`: after so long it no longer waits for parts that do not close."""
        self._asked: LoaderInfo | None = None
        self._patience_s = patience_s

    def ask(self, found: LoaderInfo | None) -> None:
        """End the program as a signal would, so that nothing that was accepted is lost."""
        self._asked = found
        if found is not None:
            late = threading.Timer(self._patience_s, self.finish)
            late.daemon = True
            late.start()
            signal.raise_signal(signal.SIGINT if os.name == "nt" else signal.SIGTERM)

    def finish(self) -> None:
        """The last act of the program: the loader, if it was asked for."""
        if self._asked is not None:
            exit_to_loader(self._asked)


RESTART = RestartRequest()
