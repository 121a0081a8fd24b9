"""The gateway's private data directory, as keys, passwords' hashes and what robots saw are in it, and the
files that hold a secret.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from metaros.errors import ConfigError

__all__ = ["make_private", "others_can_read"]

GROUP_READS = 0o040
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


def others_can_read(path: Path) -> bool:
    """Whether somebody but the gateway's user may read a file with a secret; OSError where there is none.

    Root may let the gateway in by its group: so Kubernetes mounts a secret for a program that is not root.
    """
    if sys.platform == "win32":
        return False
    else:
        found = path.stat()
        lets_in = GROUP_READS if found.st_uid == 0 and os.getuid() != 0 else 0
        return bool(found.st_mode & 0o077 & ~lets_in)
