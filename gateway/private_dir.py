"""The gateway's data directory: this user's alone, as keys, passwords' hashes and what robots saw are in it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from metaros.errors import ConfigError

__all__ = ["make_private"]

OTHERS = 0o007  # a group may have been let in on purpose, for backups say; nobody lets in all by intent


def make_private(folder: Path) -> Path:
    """The folder, made 0700 where there is none; from one that is there the rest of the machine is shut out.

    Raises:
        ConfigError: it cannot be made, or cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if sys.platform != "win32":
            found = folder.stat()
            if found.st_uid == os.getuid() and found.st_mode & OTHERS:
                folder.chmod(found.st_mode & 0o7777 & ~OTHERS)
    except OSError as error:
        raise ConfigError(f"--data-dir {folder}: {error.strerror or error}") from error
    if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
        raise ConfigError(f"--data-dir {folder}: this user cannot write there\nchown it, or choose another one")
    return folder
