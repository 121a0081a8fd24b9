"""The agent's own directory: outbox, store id, budget; one process at a time.

The lock is the operating system's and goes with the process, however it ends.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from edge_agent.errors import DiskError
from metaros.concurrency.file_lock import take_lock
from metaros.errors import ConfigError

__all__ = ["default_state_dir", "locked"]

_PLAIN: Final = re.compile(r"[A-Za-z0-9_.-]{1,64}\Z")


def default_state_dir(name: str) -> Path:
    """Where the agent of a robot keeps its state when nobody says.

    Raises:
        ConfigError: the name is no plain part of a path, so this would be another directory.
    """
    if not _PLAIN.match(name) or name in (".", ".."):
        raise ConfigError(f"{name[:80]!r} is no id of a robot: 1 to 64 letters, digits, _, . and -")
    return Path.home() / ".metaros" / "agent" / name


@contextmanager
def locked(directory: Path) -> Iterator[Path]:
    """Hold the directory while the block runs.

    Raises:
        ConfigError: another agent holds it; names its process.
        DiskError: the directory cannot be made.
    """
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)  # what the robot sees is nobody else's here
        descriptor = os.open(directory / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise DiskError(f"cannot use {directory}: {error.strerror}") from error
    try:
        if not take_lock(descriptor):
            pid = holder(descriptor)
            raise ConfigError(
                f"another agent{f' (process {pid})' if pid else ''} uses {directory}\n"
                "Give this one its own with --state-dir, or another --name."
            )
        with contextlib.suppress(OSError):  # a full disk: the number is only for people
            os.ftruncate(descriptor, 0)
            os.write(descriptor, str(os.getpid()).encode())
        yield directory
    finally:
        os.close(descriptor)


def holder(descriptor: int) -> str:
    """The number of the process that holds the directory; empty where it could not write it."""
    try:
        os.lseek(descriptor, 0, os.SEEK_SET)
        return os.read(descriptor, 32).decode(errors="replace").strip()
    except OSError:
        return ""
