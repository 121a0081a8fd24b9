"""A store's file with its tables made, once a process: to make them costs three times what a copy does."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

from gateway.store.sqlite import DATABASE, SqliteEngine

__all__ = ["place_store"]


def place_store(folder: Path) -> Path:
    """Put an empty store into a gateway's data directory, which may be new; the directory."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / DATABASE).write_bytes(_empty())
    return folder


@functools.cache
def _empty() -> bytes:
    with tempfile.TemporaryDirectory(prefix="mrstore") as name:
        engine = SqliteEngine(Path(name))
        engine.open()
        engine.connection.execute("DELETE FROM meta WHERE key = 'store_id'")  # each copy draws its own
        engine.close()
        return (Path(name) / DATABASE).read_bytes()
