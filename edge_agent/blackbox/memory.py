"""Where the ring is kept in memory: a folder of a file system in memory, this user's alone, one for a state directory.

Files there outlive the process, `kill -9` included, and are gone with the machine's power. They are nobody's flash.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import shutil
import stat
import sys
from pathlib import Path
from typing import Final

from edge_agent.errors import DiskError

__all__ = ["KEPT_IN_MEMORY", "forget_memory", "memory_folder", "move_to_disk"]

LOG = logging.getLogger("metaros.agent.black_box")
SHARED_MEMORY: Final = Path("/dev/shm")
KEPT_IN_MEMORY: Final = "memory"  # a link in the black box's folder on disk to that in memory
_OWNER = "state_directory"


def memory_folder(disk_folder: Path, *, base: Path = SHARED_MEMORY) -> Path | None:
    """The folder in memory that belongs to that on disk, made where there is none; None where memory has no files.

    Folders whose agent's state is gone are deleted.
    """
    if sys.platform == "win32" or not base.is_dir():
        return None
    prefix = f"metaros-black-box-{os.getuid()}-"
    folder = base / (prefix + hashlib.sha256(os.fsencode(disk_folder.resolve())).hexdigest()[:16])
    try:
        _forget_orphans(base, prefix)
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        facts = folder.lstat()
        if not stat.S_ISDIR(facts.st_mode) or facts.st_uid != os.getuid() or stat.S_IMODE(facts.st_mode) & 0o077:
            LOG.warning("%s is somebody else's: the black box is kept on disk", folder)
            return None
        (folder / _OWNER).write_text(str(disk_folder.resolve()))
        disk_folder.mkdir(parents=True, exist_ok=True)
        link = disk_folder / KEPT_IN_MEMORY
        link.unlink(missing_ok=True)
        link.symlink_to(folder)
    except OSError as error:
        LOG.warning("no memory for the black box, it is kept on disk: %s", error)
        return None
    return folder


def move_to_disk(path: Path, folder: Path) -> Path:
    """Move a file from memory to a folder on disk, synced; raises DiskError, and then it stays where it is."""
    target, draft = folder / path.name, folder / f"{path.name}.partial"
    try:
        with path.open("rb") as source, draft.open("wb") as stream:
            shutil.copyfileobj(source, stream, 1 << 20)
            stream.flush()
            os.fsync(stream.fileno())
        draft.replace(target)
        path.unlink(missing_ok=True)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise DiskError(f"cannot keep {path.name}: {error.strerror or error}") from error
    return target


def forget_memory(folder: Path, disk_folder: Path) -> None:
    """Nothing is kept in memory any more."""
    shutil.rmtree(folder, ignore_errors=True)
    with contextlib.suppress(OSError):
        (disk_folder / KEPT_IN_MEMORY).unlink(missing_ok=True)


def _forget_orphans(base: Path, prefix: str) -> None:
    for other in base.glob(f"{prefix}*"):
        owner = other / _OWNER
        with contextlib.suppress(OSError):
            if owner.is_file() and not Path(owner.read_text()).exists():
                shutil.rmtree(other)
