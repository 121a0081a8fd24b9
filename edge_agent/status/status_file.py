"""The status file: JSON that says the program is ready, written in one piece and removed at the end."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["status_file"]


@contextmanager
def status_file(path: Path | None, **facts: object) -> Iterator[None]:
    """While the block runs, `path` (if any) holds {"pid", "ready": true, …facts}."""
    if path is None:
        yield
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{os.getpid()}")
    partial.write_text(json.dumps({"pid": os.getpid(), "ready": True, **facts}) + "\n")
    partial.replace(path)
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
