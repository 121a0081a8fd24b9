"""Leader election for this host's metrics: of several agents in one graph one publishes, the others wait.

The turn is a locked file in the user's runtime directory, one for each router, domain and namespace. The system gives
it up at any kind of death, and within a second the next agent has it: of two `metaros up`s on one router, the second
goes on where the first ends.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

from metaros.cli.shared.instances import runtime_dir
from metaros.concurrency.file_lock import take_lock

__all__ = ["election_lock", "hold_leadership"]

RETRY_S = 1.0


def election_lock(*, zenoh_port: int, domain: int, namespace: str) -> Path:
    """The lock file of the metrics of one namespace in one graph."""
    place = "-".join(("host", str(zenoh_port), str(domain), *namespace.strip("/").split("/")))
    return runtime_dir() / f"{place.rstrip('-')}.turn"


@contextlib.asynccontextmanager
async def hold_leadership(path: Path, *, retry_s: float = RETRY_S) -> AsyncIterator[None]:
    """Wait for leadership, and hold it."""
    with path.open("a") as file:
        while not take_lock(file.fileno()):  # noqa: ASYNC110 - another process holds it: nothing tells when it ends
            await asyncio.sleep(retry_s)
        yield
