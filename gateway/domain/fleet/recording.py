"""A recording: a clip cut from a robot's black box, from the request to the file that the gateway keeps."""

from __future__ import annotations

import re
import secrets
from dataclasses import dataclass

__all__ = [
    "CUTTING",
    "FAILED",
    "REQUESTED",
    "STORED",
    "TRANSFERRING",
    "UNFINISHED",
    "Recording",
    "is_recording_id",
    "new_recording_id",
    "plain_time",
]

REQUESTED, CUTTING, TRANSFERRING, STORED, FAILED = "requested", "cutting", "transferring", "stored", "failed"
LATEST_NS = 1 << 62  # in the year 2116
UNFINISHED = (REQUESTED, CUTTING, TRANSFERRING)

_ALPHABET = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"  # Crockford's: no I, L, O, U
_ID = re.compile(f"[{_ALPHABET}]{{26}}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """One recording as the store has it; times are ns since the epoch, by the robot's clock but for `requested_ns`
    and `live_ns`.

    `from_ns` to `to_ns` was asked; `first_ns` to `last_ns` is what the black box had of it, 0 until it said so.
    """

    id: str
    robot: str
    state: str
    from_ns: int
    to_ns: int
    topics: tuple[str, ...]
    requested_ns: int
    live_ns: int  # when something last happened to it
    first_ns: int = 0
    last_ns: int = 0
    size_bytes: int = 0
    received_bytes: int = 0
    messages: int = 0
    sha256: str = ""
    code: str = ""  # why it failed
    message: str = ""  # the same for people; of an unfinished one: what holds it up
    object: str | None = None

    @property
    def unfinished(self) -> bool:
        """Whether more is to come."""
        return self.state in UNFINISHED


def plain_time(stamp_ns: int) -> int:
    """A time that an agent told; 0 where it is none that a calendar could show."""
    return stamp_ns if 0 < stamp_ns < LATEST_NS else 0


def is_recording_id(text: str) -> bool:
    """Whether a text is an id as `new_recording_id` makes them: safe in file names, too."""
    return _ID.fullmatch(text) is not None


def new_recording_id(now_ns: int) -> str:
    """A ULID: 48 bits of milliseconds, then 80 random ones, in 26 characters that sort by time."""
    number = (now_ns // 10**6) << 80 | secrets.randbits(80)
    return "".join(_ALPHABET[number >> shift & 31] for shift in range(125, -5, -5))
