"""The twin's persistent record: a single file, so that no crash can leave a mixture of two documents."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

__all__ = ["OWN", "Pending", "Record", "Version"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Version:
    """A document and its revision; revision 0 is the robot's own settings."""

    revision: int = 0
    document: bytes = b"{}"

    @property
    def sha256(self) -> bytes:
        """Of the document."""
        return hashlib.sha256(self.document).digest()


OWN = Version()


@dataclass(frozen=True, slots=True, kw_only=True)
class Pending:
    """A version on trial. `until_s` is by the monotonic clock of the run of the system that `boot_id` names."""

    version: Version
    until_s: float
    boot_id: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """`applied` is the last version that was confirmed, `seen` the newest revision that came, whatever became of it.

    `code` and `message` say why the newest one was taken back or refused; "" where it was not.
    """

    applied: Version = OWN
    pending: Pending | None = None
    seen: int = 0
    undone: str = ""  # reverted, refused
    code: str = ""
    message: str = ""
