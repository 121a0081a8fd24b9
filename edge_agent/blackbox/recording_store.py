"""Recordings that were cut and wait for the gateway: an MCAP file each, and a small JSON file beside it that names it.

The event loop owns it. A file counts once its JSON is there, so a cut that a crash interrupted leaves nothing. A file
that does not hold what its JSON says is reported as failed rather than sent.
"""

from __future__ import annotations

import contextlib
import json
import logging
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from edge_agent.blackbox.clip import Clip
from edge_agent.errors import DiskError, ManyRecordingsError
from edge_agent.outbox import OsDisk
from metaros.errors import UsageError
from metaros.limits import LIMITS, Limits

__all__ = ["RecordingStore", "SavedRecording"]

LOG = logging.getLogger("metaros.agent.black_box")
_ID: Final = re.compile(r"[0-9A-HJKMNP-TV-Z]{26}\Z")
_SHA256: Final = re.compile(r"([0-9a-f]{64})?\Z")
_FACTS_BYTES: Final = 4096
_REMEMBERED: Final = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedRecording:
    """A recording that waits; `failed` says by a code why there is no file that could be sent."""

    recording_id: str
    made_ns: int
    size_bytes: int
    sha256: str  # hex
    from_ns: int
    to_ns: int
    messages: int
    failed: str = ""


class RecordingStore:
    """At most `limits.recordings` files of `limits.recordings_bytes` together."""

    def __init__(self, folder: Path, *, limits: Limits = LIMITS) -> None:
        """Read what waits; DiskError."""
        self._folder, self._limits = folder, limits
        self._disk = OsDisk(folder)
        self._saved: dict[str, SavedRecording] = {}
        self._gone: dict[str, None] = {}  # the newest that the gateway has, or does not want
        self._read_all()

    def __iter__(self) -> Iterator[SavedRecording]:
        return iter(list(self._saved.values()))

    def __len__(self) -> int:
        return len(self._saved)

    @property
    def size_bytes(self) -> int:
        """All files together."""
        return sum(saved.size_bytes for saved in self._saved.values())

    def get(self, recording_id: str) -> SavedRecording | None:
        """The recording of that id, if it waits."""
        return self._saved.get(recording_id)

    def was_here(self, recording_id: str) -> bool:
        """Whether the gateway got that recording from this process, or did not want it."""
        return recording_id in self._gone

    def check(self, recording_id: str, *, size_bytes: int = 0) -> None:
        """Raise UsageError for an id that is none, ManyRecordingsError where there is no room for one more so large."""
        if not _ID.match(recording_id):
            raise UsageError(f"{recording_id[:40]!r} is no id of a recording: 26 letters and digits of a ULID")
        if len(self._saved) >= self._limits.recordings:
            raise ManyRecordingsError(f"{len(self._saved)} recordings wait for the gateway already")
        if self.size_bytes + size_bytes > self._limits.recordings_bytes:
            raise ManyRecordingsError(
                f"recordings of {self.size_bytes} bytes wait for the gateway, and this one may take {size_bytes}: "
                f"the robot keeps {self._limits.recordings_bytes}"
            )

    def draft(self, recording_id: str) -> Path:
        """Where to write a file that is to be added."""
        return self._folder / f"{recording_id}.partial"

    def keep(self, recording_id: str, clip: Clip, *, made_ns: int) -> SavedRecording:
        """Put the draft in its place, synced; to be called on any thread, with `add` after it. DiskError."""
        saved = SavedRecording(
            recording_id=recording_id,
            made_ns=made_ns,
            size_bytes=clip.size_bytes,
            sha256=clip.sha256.hex(),
            from_ns=clip.from_ns,
            to_ns=clip.to_ns,
            messages=clip.messages,
        )
        try:
            self.draft(recording_id).replace(self._path(recording_id))
        except OSError as error:
            raise DiskError(f"cannot keep the recording: {error.strerror or error}") from error
        self._disk.replace(f"{recording_id}.json", json.dumps(asdict(saved)).encode())
        return saved

    def add(self, saved: SavedRecording) -> None:
        """It waits from now on."""
        self._saved[saved.recording_id] = saved

    def read(self, recording_id: str, offset: int, size_bytes: int) -> bytes:
        """So many bytes of the file; DiskError where they are not there."""
        data = self._disk.read(f"{recording_id}.mcap", offset, size_bytes)
        if len(data) != size_bytes:
            raise DiskError(f"{recording_id}.mcap is shorter than it was")
        return data

    def fail(self, recording_id: str, code: str) -> None:
        """Its file is of no use; this is reported until the gateway has acknowledged it."""
        saved = self._saved[recording_id]
        LOG.warning("the recording %s cannot be sent: %s", recording_id, code)
        facts = {**asdict(saved), "size_bytes": 0, "sha256": "", "failed": code}
        self._saved[recording_id] = SavedRecording(**facts)
        self._unlink(recording_id, "mcap")
        with contextlib.suppress(DiskError):  # the next run finds out anew
            self._disk.replace(f"{recording_id}.json", json.dumps(facts).encode())

    def remove(self, recording_id: str) -> None:
        """The gateway has it, or does not want it; nothing happens for an id that is not here."""
        if self._saved.pop(recording_id, None) is None:
            return
        self._unlink(recording_id, "json")
        self._unlink(recording_id, "mcap")
        self._gone[recording_id] = None
        if len(self._gone) > _REMEMBERED:
            del self._gone[next(iter(self._gone))]

    def _read_all(self) -> None:
        """What is there, oldest first; leftovers of interrupted cuts are deleted."""
        found: list[SavedRecording] = []
        names = {Path(name).stem for name in self._disk.names(".") if _ID.match(Path(name).stem)}
        for recording_id in names:
            self._unlink(recording_id, "partial")
            saved = self._facts(recording_id)
            if saved is None:
                self._unlink(recording_id, "json")
                self._unlink(recording_id, "mcap")
                continue
            found.append(saved)
        for saved in sorted(found, key=lambda one: (one.made_ns, one.recording_id)):
            self._saved[saved.recording_id] = saved
            if not saved.failed and self._disk.size(f"{saved.recording_id}.mcap") != saved.size_bytes:
                self.fail(saved.recording_id, "damaged")

    def _facts(self, recording_id: str) -> SavedRecording | None:
        name = f"{recording_id}.json"
        try:
            facts = json.loads(self._disk.read(name, 0, _FACTS_BYTES)) if self._disk.size(name) else None
            saved = SavedRecording(**facts) if facts is not None else None
        except (ValueError, TypeError, RecursionError):
            return None
        if saved is not None and not _is_sound(saved):
            return None
        return saved if saved is not None and saved.recording_id == recording_id else None

    def _path(self, recording_id: str) -> Path:
        return self._folder / f"{recording_id}.mcap"

    def _unlink(self, recording_id: str, ending: str) -> None:
        with contextlib.suppress(DiskError):
            self._disk.remove(f"{recording_id}.{ending}")


def _is_sound(saved: SavedRecording) -> bool:
    """Whether every fact is of its kind, so that it can be reported to the gateway."""
    numbers = (saved.made_ns, saved.size_bytes, saved.from_ns, saved.to_ns, saved.messages)
    texts = (saved.recording_id, saved.sha256, saved.failed)
    return (
        all(type(number) is int and 0 <= number < 1 << 63 for number in numbers)
        and all(isinstance(text, str) for text in texts)
        and _SHA256.match(saved.sha256) is not None
    )
