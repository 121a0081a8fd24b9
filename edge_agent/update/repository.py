"""The signed repository as the robot sees it: `tuf`'s client, with a pinned root and a memory of its own.

The root is pinned at first use: the file that was shipped to the robot, else the first one that the gateway of its
enrolment gives over a link that the fleet vouches for. From then on only who holds a root's keys can name the next.

`seen.json` remembers, synced, the time of the last good look and the versions of the signed files. The time that
expiry is judged by is never earlier, whatever the clock says; and a damaged copy of the signed files, or none, opens
no way back to older ones. A root with other keys for timestamp or snapshot clears the versions: so a fleet gets out of
an attack that drove them up.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tuf.api import exceptions
from tuf.api.metadata import Metadata, Root, TargetFile
from tuf.ngclient import FetcherInterface, Updater

from edge_agent.update.errors import (
    SlotError,
    UpdateError,
    UpdateExpiredError,
    UpdateFetchError,
    UpdateMetadataError,
    UpdateMismatchError,
    UpdateRollbackError,
    UpdateSlowError,
    UpdateTooLargeError,
    UpdateUnknownError,
    UpdateUnsignedError,
)
from edge_agent.update.files import read_table, replace_table, sync_files
from metaros.clock import Clock

__all__ = ["Fetched", "SignedRepository", "as_update_error"]

ROOT_BYTES = 512_000
_CODES: tuple[tuple[type[Exception], type[UpdateError]], ...] = (
    (exceptions.DownloadLengthMismatchError, UpdateTooLargeError),
    (exceptions.SlowRetrievalError, UpdateSlowError),
    (exceptions.DownloadError, UpdateFetchError),
    (exceptions.UnsignedMetadataError, UpdateUnsignedError),
    (exceptions.ExpiredMetadataError, UpdateExpiredError),
    (exceptions.LengthOrHashMismatchError, UpdateMismatchError),
    (exceptions.BadVersionNumberError, UpdateRollbackError),
)


@dataclass(frozen=True, slots=True)
class Fetched:
    """A target on the disk, and what was signed of it."""

    path: Path
    target: TargetFile

    @property
    def custom(self) -> Mapping[str, Any]:
        """The signed field `custom`."""
        found = self.target.custom
        return found if isinstance(found, dict) else {}


class SignedRepository:
    """The folder `update` of the state directory. `url` is the gateway's `…/api/v1/updates`. Methods block."""

    def __init__(
        self, folder: Path, url: str, fetcher: FetcherInterface, clock: Clock, *, shipped_root: Path | None = None
    ) -> None:
        self._folder = folder
        self._url = url.rstrip("/")
        self._fetcher = fetcher
        self._clock = clock
        self._shipped = shipped_root

    def fetch(self, paths: list[str]) -> Fetched:
        """The first of these targets that is signed, downloaded and checked. Raises UpdateError."""
        with _words():
            updater = self._updater()
            updater.refresh()
            self._remember(updater)
            for path in paths:
                if (target := updater.get_targetinfo(path)) is not None:
                    self._make_room(target.length)
                    place = self._folder / "bundle.zip"
                    updater.download_target(target, str(place))
                    return Fetched(place, target)
        raise UpdateUnknownError(f"{paths[-1]} is not among the signed files")

    def _updater(self) -> Updater:
        metadata = self._folder / "metadata"
        metadata.mkdir(mode=0o700, parents=True, exist_ok=True)
        updater = Updater(
            str(metadata),
            f"{self._url}/metadata/",
            target_base_url=f"{self._url}/targets/",
            fetcher=self._fetcher,
            bootstrap=self._root(),
        )
        updater._trusted_set.reference_time = self._now()
        return updater

    def _root(self) -> bytes:
        """The pinned root; pinned now where there is none."""
        pinned = self._folder / "root.json"
        if pinned.exists():
            return pinned.read_bytes()
        if self._shipped is not None:
            data = self._shipped.read_bytes()
        else:
            data = self._fetcher.download_bytes(f"{self._url}/metadata/1.root.json", ROOT_BYTES)
        root = Metadata[Root].from_bytes(data)
        root.signed.verify_delegate(Root.type, root.signed_bytes, root.signatures)
        draft = pinned.with_suffix(".tmp")
        with draft.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(pinned)
        return data

    def _now(self) -> datetime:
        """The clock's time, or that of the last good look where the clock is behind it."""
        seen_ns = read_table(self._folder / "seen.json").get("time_ns", 0)
        now_ns = max(self._clock.wall_ns(), seen_ns if isinstance(seen_ns, int) else 0)
        return datetime.fromtimestamp(now_ns // 1_000_000_000, UTC)

    def _remember(self, updater: Updater) -> None:
        """Compare what was found with what was seen before, and keep it.

        Raises:
            UpdateRollbackError: it is older.
        """
        found = updater._trusted_set
        keys = sorted([*found.root.roles["timestamp"].keyids, *found.root.roles["snapshot"].keyids])
        versions = {"timestamp": found.timestamp.version, "snapshot": found.snapshot.version}
        versions |= {name.removesuffix(".json"): meta.version for name, meta in found.snapshot.meta.items()}
        seen = read_table(self._folder / "seen.json")
        _not_older("root", found.root.version, seen.get("root"))
        if seen.get("keys") == keys:
            before = seen.get("versions")
            for name, version in (before if isinstance(before, dict) else {}).items():
                _not_older(name, versions.get(name, 0), version)
        now_ns = round(found.reference_time.timestamp()) * 1_000_000_000
        table = {"time_ns": now_ns, "root": found.root.version, "keys": keys, "versions": versions}
        if table != seen:
            sync_files(self._folder / "metadata")  # tuf itself syncs nothing
            replace_table(self._folder / "seen.json", table)

    def _make_room(self, size_bytes: int) -> None:
        free = shutil.disk_usage(self._folder).free
        if free < 4 * size_bytes:  # the part, the bundle, what is in it, and its environment
            raise SlotError(f"the update needs {4 * size_bytes} bytes of the disk, and {free} are free")


def _not_older(name: str, version: int, seen: object) -> None:
    if isinstance(seen, int) and version < seen:
        raise UpdateRollbackError(f"{name} is version {version}, and this robot has seen {seen}")


@contextmanager
def _words() -> Iterator[None]:
    try:
        yield
    except UpdateError:
        raise
    except Exception as error:
        raise as_update_error(error) from error


def as_update_error(error: Exception) -> UpdateError:
    """An error of `tuf` as an UpdateError; any other error is one of malformed bytes from outside."""
    text = str(error).splitlines()[0][:300] if str(error) else type(error).__name__
    if isinstance(error, exceptions.DownloadHTTPError) and error.status_code == 401:
        return UpdateFetchError("the gateway does not take this robot's token (HTTP 401)")
    for kind, ours in _CODES:
        if isinstance(error, kind):
            return ours(text)
    if isinstance(error, OSError):
        return SlotError(f"cannot keep the signed files: {error.strerror or text}")
    return UpdateMetadataError(text)
