"""Small files of the update's state: replaced as a whole and synced, so that a power cut leaves the old or the new.

`calls` is `os`, or what stands in for it where a test stops the machine at every system call.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from edge_agent.update.errors import SlotError

__all__ = ["read_table", "remove_file", "replace_table", "sync_all", "sync_files", "sync_folder"]

FILE_BYTES = 256 * 1024


def read_table(path: Path) -> dict[str, Any]:
    """The JSON object of a file; empty where there is none, or none that can be read."""
    try:
        with path.open("rb") as file:
            table = json.loads(file.read(FILE_BYTES))
    except (OSError, ValueError, RecursionError):
        return {}
    return table if isinstance(table, dict) else {}


def replace_table(path: Path, table: dict[str, Any], *, calls: Any = os) -> None:
    """Put a JSON object in the place of what has that name, on the disk before this returns. Raises SlotError."""
    draft = path.with_name(f"{path.name}.tmp")
    data = json.dumps(table, sort_keys=True).encode()
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
        descriptor = calls.open(draft, flags, 0o600)
        try:
            calls.ftruncate(descriptor, 0)
            view = memoryview(data)
            while view:
                view = view[calls.write(descriptor, view) :]
            calls.fsync(descriptor)
        finally:
            calls.close(descriptor)
        calls.replace(draft, path)
        sync_folder(path.parent, calls=calls)
    except OSError as error:
        raise SlotError(f"cannot write {path}: {error.strerror or error}") from error


def remove_file(path: Path, *, calls: Any = os) -> None:
    """Delete a file for good; nothing happens where there is none. Raises SlotError."""
    try:
        if os.path.lexists(path):
            calls.unlink(path)
            sync_folder(path.parent, calls=calls)
    except OSError as error:
        raise SlotError(f"cannot delete {path}: {error.strerror or error}") from error


def sync_folder(path: Path, *, calls: Any = os) -> None:
    """Make new and deleted names last; Windows has no such call and needs none."""
    if sys.platform != "win32":
        descriptor = calls.open(path, os.O_RDONLY)
        try:
            calls.fsync(descriptor)
        finally:
            calls.close(descriptor)


def sync_all(folder: Path) -> None:
    """Put everything below a folder on the disk: by one call for all where there is one, else file by file."""
    if sys.platform == "linux":  # elsewhere the call does not wait
        os.sync()  # an environment has thousands of files, and an SD card takes 10 ms for each
    else:
        sync_files(folder)


def sync_files(folder: Path) -> None:
    """Put the few files below a folder, and their names, on the disk."""
    folders = [folder, *(path for path in folder.rglob("*") if path.is_dir())]
    for path in folder.rglob("*"):
        if path.is_file():
            with path.open("r+b") as file:
                os.fsync(file.fileno())
    for path in folders:
        sync_folder(path)
