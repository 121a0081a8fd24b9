"""Commit-confirmed: a new document is tried, and kept only when the gateway says so over a link that lives with it.

Sans I/O: what happened goes in, what is to be done comes out, in order. The shell does it: `Persist` puts the record on
the disk, and nothing after it is done where that fails (`persist_failed`); `Apply` puts a version into force; `Report`
sends a report to the gateway. Whatever comes in which order, and wherever the process dies, the robot ends with a
document that was confirmed. A revision is tried once: after it was taken back it stays so until another comes.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from edge_agent.twin.record import Pending, Record, Version
from metaros.clock import Clock
from metaros.errors import UsageError
from metaros.fleet.twin import parse, read
from metaros.limits import LIMITS, Limits

__all__ = ["Action", "Apply", "CommitConfirm", "Persist", "Report", "State", "risky"]

RETRY_S = 1.0  # between tries to put on the disk what must be there
AGAIN_S = 10.0  # until a version that the disk did not take is tried again
LINK_SECTIONS = ("topics", "nodes", "budget", "agent")  # what can starve a link
State = Literal["applied", "applying", "confirming", "reverted", "refused"]


@dataclass(frozen=True, slots=True)
class Persist:
    """Put the record on the disk, at once or not at all."""

    record: Record


@dataclass(frozen=True, slots=True)
class Apply:
    """Put this version into force; then call `applied`, or `apply_failed`."""

    version: Version


@dataclass(frozen=True, slots=True)
class Report:
    """Report how it stands, even where nothing changed."""


Action = Persist | Apply | Report


@dataclass(frozen=True, slots=True)
class _Broken:
    """A version that the disk did not take: it is tried again later."""

    pending: Pending
    window_s: float
    code: str
    message: str
    again_s: float


class CommitConfirm:
    """The state of one agent process. `record` is what was on the disk when it began."""

    def __init__(
        self,
        record: Record,
        clock: Clock,
        *,
        boot_id: str,
        limits: Limits = LIMITS,
        check: Callable[[bytes], object] = parse,
    ) -> None:
        """`check` raises a UsageError for a document that this agent does not take."""
        self._clock = clock
        self._boot_id = boot_id
        self._limits = limits
        self._check = check
        self._record = self._on_disk = record
        self._up_s = math.inf  # since when the link is up
        self._lived_s = math.inf  # since when what is on trial is in force
        self._settle_s = 0.0
        self._asked = False  # whether the gateway was asked, over this link, to confirm
        self._granted = False  # it did; what is left is the disk
        self._retry_s = math.inf
        self._window_s = 0.0  # of what is on trial
        self._broken: _Broken | None = None

    @property
    def record(self) -> Record:
        """What is, or is about to be, on the disk."""
        return self._record

    @property
    def active_version(self) -> Version:
        """The version that is in force, or is being applied."""
        pending = self._record.pending
        return pending.version if pending is not None else self._record.applied

    @property
    def state(self) -> State:
        """How it stands with the newest revision."""
        if self._record.pending is not None:
            return "confirming" if self._asked else "applying"
        if self._broken is not None:
            return "refused"
        return "reverted" if self._record.undone == "reverted" else "refused" if self._record.undone else "applied"

    @property
    def why(self) -> tuple[str, str]:
        """Code and message of what was reverted or refused."""
        if self._record.pending is not None:
            return "", ""
        record = self._broken or self._record
        return record.code, record.message

    @property
    def revision(self) -> int:
        """The newest desired one that came; 0: none."""
        return self._broken.pending.version.revision if self._broken is not None else self._record.seen

    # -- what happens -----------------------------------------------------------------------------------------------

    def start(self) -> list[Action]:
        """The process begins: a version on trial goes on only in the same run of the system, within its window."""
        pending = self._record.pending
        if pending is None:
            return [Apply(self._record.applied)]
        left_s = pending.until_s - self._clock.monotonic_s()
        same = bool(self._boot_id) and pending.boot_id == self._boot_id
        if same and 0 < left_s <= self._limits.twin_window_most_s:
            return self._try(pending, self._record.applied)
        return self._back("not_confirmed", "the agent was started again after the window, or nobody knows when it was")

    def desired(self, revision: int, sha256: bytes, document: bytes, window_s: float) -> list[Action]:
        """The gateway says what the robot is to be, and how long the confirmation may take; 0: the usual."""
        if revision <= self._record.seen:
            return [Report()]  # an old one, or one that was tried
        self._broken = None
        try:
            if hashlib.sha256(document).digest() != sha256:
                raise UsageError("the document does not have the digest that came with it")
            self._check(document)
        except UsageError as error:
            return self._refuse(revision, error.code, str(error))
        limits = self._limits
        window_s = min(max(window_s or limits.twin_window_s, limits.twin_window_least_s), limits.twin_window_most_s)
        self._window_s = window_s
        version = Version(revision=revision, document=document)
        until_s = self._clock.monotonic_s() + window_s
        pending = Pending(version=version, until_s=until_s, boot_id=self._boot_id)
        before = self.active_version
        self._record = Record(applied=self._record.applied, pending=pending, seen=revision)
        return [Persist(self._record), *self._try(pending, before)]

    def applied(self) -> list[Action]:
        """A `Apply` is done."""
        if self._record.pending is not None:
            self._lived_s = self._clock.monotonic_s()
        return self.tick()

    def apply_failed(self, code: str, message: str) -> list[Action]:
        """A `Apply` could not be done."""
        if self._record.pending is None:
            return []
        return self._back(code, message, undone="refused")

    def confirmed(self, revision: int) -> list[Action]:
        """The gateway says: keep it."""
        pending = self._record.pending
        if pending is None or pending.version.revision != revision or self._lived_s == math.inf:
            return []
        if self._clock.monotonic_s() >= pending.until_s:
            return self.tick()
        self._granted = True
        return self._commit()

    def link(self, up: bool) -> list[Action]:
        """The link came up, or is down."""
        self._up_s = self._clock.monotonic_s() if up else math.inf
        self._asked = False
        return [*self.tick(), Report()] if up else []

    def tick(self) -> list[Action]:
        """Time has passed; call after `wait_s`."""
        now_s, pending = self._clock.monotonic_s(), self._record.pending
        if pending is not None and now_s >= pending.until_s:
            return self._back("not_confirmed", "the gateway did not confirm it within its window")
        if now_s >= self._retry_s:
            return self._commit() if self._granted else self._write()
        if (broken := self._broken) is not None and now_s >= broken.again_s:
            version = broken.pending.version
            return self.desired(version.revision, version.sha256, version.document, broken.window_s)
        if pending is not None and not self._asked and now_s >= self._ready_s():
            self._asked = True
            return [Report()]
        return []

    def wait_s(self) -> float | None:
        """Seconds until `tick` may have something to do; None: not by time alone."""
        due = [self._retry_s, self._broken.again_s if self._broken is not None else math.inf]
        if self._record.pending is not None:
            due.append(self._record.pending.until_s)
            if not self._asked:
                due.append(self._ready_s())
        nearest_s = min(due)
        return None if nearest_s == math.inf else max(0.0, nearest_s - self._clock.monotonic_s())

    def persisted(self, record: Record) -> None:
        """A `Persist` is done."""
        self._on_disk = record

    def persist_failed(self, code: str, message: str) -> list[Action]:
        """A `Persist` failed: what was on the disk still is."""
        wanted, now_s = self._record, self._clock.monotonic_s()
        if self._granted:
            self._record, self._retry_s = self._on_disk, now_s + RETRY_S  # on trial still, until the window ends
            return []
        if wanted.pending is None:
            self._retry_s = now_s + RETRY_S  # the robot has gone back, or never went: the disk learns it later
            return [Report()]
        self._broken = _Broken(wanted.pending, self._window_s, code, message, now_s + AGAIN_S)
        self._lived_s = math.inf
        before, self._record = self._on_disk.pending, replace(self._on_disk, pending=None)
        if before is None:
            return [Report()]
        self._retry_s = now_s + RETRY_S  # what was on trial until now is not wanted any more
        self._record = replace(self._record, undone="reverted", code=code, message=message)
        return [Apply(self._record.applied), Report()]

    # -- what is to be done -----------------------------------------------------------------------------------------

    def _try(self, pending: Pending, before: Version) -> list[Action]:
        self._asked = self._granted = False
        self._lived_s = self._retry_s = math.inf
        left_s = pending.until_s - self._clock.monotonic_s()
        harm = risky(self._record.applied.document, pending.version.document) or risky(
            before.document, pending.version.document
        )
        self._settle_s = min(self._limits.twin_settle_s, left_s / 4) if harm else 0.0
        return [Apply(pending.version), Report()]

    def _ready_s(self) -> float:
        """When the link has lived long enough with what is on trial; infinite while it is down."""
        return max(self._up_s, self._lived_s) + self._settle_s

    def _commit(self) -> list[Action]:
        pending = self._record.pending
        assert pending is not None
        self._record = Record(applied=pending.version, seen=self._record.seen)
        self._retry_s = math.inf
        return [Persist(self._record), Report()]

    def _refuse(self, revision: int, code: str, message: str) -> list[Action]:
        """It is not tried; what was on trial before it is not wanted any more."""
        if self._record.pending is not None:
            return self._back(code, message, undone="refused", seen=revision)
        self._record = replace(self._record, seen=revision, undone="refused", code=code, message=message)
        return self._write()

    def _back(self, code: str, message: str, *, undone: str = "reverted", seen: int = 0) -> list[Action]:
        """Live by the last confirmed version; first that, then the disk, which may be what is full."""
        applied = self._record.applied
        self._record = Record(
            applied=applied, seen=max(seen, self._record.seen), undone=undone, code=code, message=message
        )
        self._asked = self._granted = False
        self._lived_s = math.inf
        return [Apply(applied), *self._write()]

    def _write(self) -> list[Action]:
        self._retry_s = math.inf
        return [Persist(self._record), Report()]


def risky(before: bytes, after: bytes) -> bool:
    """Whether the change from one document to another touches what a link can suffer from."""
    try:
        one, other = read(before), read(after)
    except UsageError:
        return True
    return any(one.get(name) != other.get(name) for name in LINK_SECTIONS)
