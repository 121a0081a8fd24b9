"""The running `metaros up` instances of this user: each claims ports and robots in a state file that it keeps locked.

The lock, not the process id, says whether an instance lives: the system releases it at any kind of death, and an id
may be somebody else's by then. Claims are made under one short lock for all, so that two instances started in the
same moment cannot choose the same ports or robot names.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO

from metaros.concurrency.file_lock import file_lock, take_lock
from metaros.errors import ConfigError

__all__ = [
    "DataDir",
    "Instance",
    "StateFile",
    "claim_lock",
    "data_root",
    "gateway_folder",
    "is_data_dir",
    "open_data_dir",
    "running_instances",
    "runtime_dir",
]

_LOCK = "lock"  # in a data directory


@dataclass(frozen=True, slots=True, kw_only=True)
class Instance:
    """What one `metaros up` has taken."""

    pid: int
    state: str  # starting, ready, stopping
    url: str = ""
    host: str = "127.0.0.1"
    http_port: int = 0
    grpc_port: int = 0
    foxglove_port: int = 0
    rosbridge_port: int = 0
    zenoh_port: int = 0
    domain: int = 0
    own_router: bool = True
    robots: tuple[str, ...] = ()
    data_dir: str = ""
    started_ns: int = 0
    processes: tuple[dict[str, object], ...] = field(default=())


def runtime_dir() -> Path:
    """Where the state files are: `$METAROS_RUNTIME_DIR`, the session's runtime directory, or a private one."""
    if named := os.environ.get("METAROS_RUNTIME_DIR"):
        path = Path(named)
    elif session := os.environ.get("XDG_RUNTIME_DIR"):
        path = Path(session) / "metaros"
    else:
        path = Path(tempfile.gettempdir()) / f"metaros-{_user()}"
    path.mkdir(parents=True, exist_ok=True, mode=0o700)
    if sys.platform != "win32" and path.stat().st_uid != os.getuid():
        raise ConfigError(f"{path} belongs to another user: set METAROS_RUNTIME_DIR to a directory of your own")
    return path


def _user() -> str:
    """Who runs this, as a part of a file name."""
    if sys.platform == "win32":
        return os.environ.get("USERNAME", "user")
    else:
        return str(os.getuid())


def data_root() -> Path:
    """The platform's place for a user's data."""
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "metaros"
    elif sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "metaros"
    else:
        return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share") / "metaros"


@contextmanager
def claim_lock() -> Iterator[None]:
    """Held while ports and names are chosen and claimed; waits for another instance that is choosing."""
    with file_lock(runtime_dir() / "claims.lock"):
        yield


class StateFile:
    """This instance's claim: locked as long as the object is open, gone when closed."""

    def __init__(self) -> None:
        self._path = runtime_dir() / f"up-{os.getpid()}.json"
        self._lock_path = self._path.with_suffix(".lock")
        self._lock = self._lock_path.open("a")
        if not take_lock(self._lock.fileno()):
            self._lock.close()
            raise ConfigError(f"{self._lock_path} is locked by another process")

    def write(self, instance: Instance) -> None:
        """Replace what `metaros status` shows, atomically."""
        draft = self._path.with_suffix(".tmp")
        draft.write_text(json.dumps(asdict(instance)))
        draft.replace(self._path)

    def withdraw(self) -> None:
        """Claim nothing for now, before something else is claimed."""
        self._path.unlink(missing_ok=True)

    def close(self) -> None:
        """Give the claim up."""
        if sys.platform == "win32":  # where an open file cannot be removed
            self._lock.close()
        for path in (self._path, self._lock_path):
            path.unlink(missing_ok=True)
        self._lock.close()


def running_instances() -> list[Instance]:
    """All instances alive, oldest first; clears away what dead ones left."""
    found = []
    for path in runtime_dir().glob("up-*.json"):
        lock_path = path.with_suffix(".lock")
        if _held(lock_path):
            with contextlib.suppress(OSError, ValueError, TypeError):
                found.append(_read(path))
        else:
            path.unlink(missing_ok=True)
            lock_path.unlink(missing_ok=True)
    return sorted(found, key=lambda instance: instance.started_ns)


def _held(lock_path: Path) -> bool:
    try:
        with lock_path.open("r+") as file:
            return not take_lock(file.fileno())
    except OSError:
        return False


def _read(path: Path) -> Instance:
    raw = json.loads(path.read_text())
    raw["robots"] = tuple(raw["robots"])
    raw["processes"] = tuple(raw["processes"])
    return Instance(**raw)


@dataclass(frozen=True, slots=True)
class DataDir:
    """A data directory that nobody else uses as long as `lock` is open."""

    path: Path
    lock: IO[str]
    note: str = ""


def is_data_dir(path: Path) -> bool:
    """Whether a `metaros up` has kept its data there."""
    return (path / _LOCK).is_file() and (path / "logs").is_dir()


def gateway_folder(path: Path) -> Path:
    """Where in its data directory the data of its gateway is."""
    return path / "gateway"


def open_data_dir(explicit: Path | None) -> DataDir:
    """Lock `explicit`, or the default directory, or where another instance has that, one beside it."""
    if explicit is not None:
        if taken := _lock_dir(explicit):
            return taken
        raise ConfigError(f"data directory {explicit} is in use by another `metaros up`")
    root = data_root()
    for number in range(1, 100):
        path = root if number == 1 else root / f"instance-{number}"
        if taken := _lock_dir(path):
            note = f"another `metaros up` uses {root}: this one keeps its data in {path}" if number > 1 else ""
            return DataDir(path, taken.lock, note)
    raise ConfigError(f"{root} has no free instance directory")


def _lock_dir(path: Path) -> DataDir | None:
    try:
        path.mkdir(parents=True, exist_ok=True)
        file = (path / _LOCK).open("a")
    except OSError as error:
        raise ConfigError(f"cannot use the data directory {path}: {error.strerror}") from error
    if take_lock(file.fileno()):
        return DataDir(path, file)
    file.close()
    return None
