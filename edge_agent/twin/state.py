"""The twin's record on the robot's disk: one file, replaced as a whole.

What is on trial and what was confirmed before it stand in the same file, so that whatever moment the power goes, the
next process reads one whole record, the old or the new. A file that cannot be read is no reason to stop a robot: it
then uses its own settings, and the gateway, seeing revision 0, sends the document again.
"""

from __future__ import annotations

import json
import logging
from typing import Any

from edge_agent.outbox import Disk
from edge_agent.twin.record import OWN, Pending, Record, Version
from metaros.errors import UsageError
from metaros.fleet.twin import MAX_BYTES, parse

__all__ = ["FILE", "TwinFile"]

LOG = logging.getLogger("metaros.agent.twin")
FILE = "twin/twin.json"
FORMAT = 1
MOST_BYTES = 16 * MAX_BYTES  # two documents as JSON texts inside JSON, every letter escaped


class TwinFile:
    """The record below the state directory. Methods block."""

    def __init__(self, disk: Disk) -> None:
        self._disk = disk

    def load(self) -> Record:
        """What was kept; an empty record where there is none, or none that can be used. Raises DiskError."""
        size = self._disk.size(FILE)
        if not size:
            return Record()
        try:
            if size > MOST_BYTES:
                raise ValueError("too long")
            record = read_record(json.loads(self._disk.read(FILE, 0, size)))
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            LOG.error("%s is damaged (%s): the robot's own settings hold", FILE, error)
            return Record()
        return usable(record)

    def keep(self, record: Record) -> None:
        """Put it in the place of the one before, on the disk when this returns. Raises DiskError."""
        self._disk.replace(FILE, json.dumps(record_table(record), indent=1).encode())


def record_table(record: Record) -> dict[str, Any]:
    """A record as JSON."""
    pending = record.pending
    return {
        "format": FORMAT,
        "applied": version_table(record.applied),
        "pending": None
        if pending is None
        else {**version_table(pending.version), "until_s": pending.until_s, "boot_id": pending.boot_id},
        "seen": record.seen,
        "undone": record.undone,
        "code": record.code,
        "message": record.message,
    }


def version_table(version: Version) -> dict[str, Any]:
    """A version as JSON."""
    return {"revision": version.revision, "document": version.document.decode()}


def read_record(table: dict[str, Any]) -> Record:
    """A record from JSON; ValueError, KeyError or TypeError where it is none."""
    if table["format"] != FORMAT:
        raise ValueError(f"its format is {table['format']!r}")
    pending = table["pending"]
    return Record(
        applied=read_version(table["applied"]),
        pending=None
        if pending is None
        else Pending(version=read_version(pending), until_s=float(pending["until_s"]), boot_id=str(pending["boot_id"])),
        seen=int(table["seen"]),
        undone=str(table["undone"]),
        code=str(table["code"]),
        message=str(table["message"]),
    )


def read_version(table: dict[str, Any]) -> Version:
    """A version from JSON."""
    return Version(revision=int(table["revision"]), document=str(table["document"]).encode())


def usable(record: Record) -> Record:
    """The record without what this agent does not take: it may be older than the one that wrote it."""
    pending, applied, seen = record.pending, record.applied, record.seen
    outcome = {"undone": record.undone, "code": record.code, "message": record.message}
    for version in filter(None, (pending.version if pending else None, applied)):
        try:
            parse(version.document)
        except UsageError as error:
            LOG.error("revision %d of the twin cannot be used by this agent: %s", version.revision, error)
            outcome = {"undone": "refused", "code": error.code, "message": str(error)}
            if version is applied:
                applied = OWN
            else:
                pending = None
    return Record(applied=applied, pending=pending, seen=seen, **outcome)
