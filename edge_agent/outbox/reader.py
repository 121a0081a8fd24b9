"""Reading a log in order: where the reader stands, and what it makes of damaged bytes."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from edge_agent.errors import DiskError
from edge_agent.outbox.disk import Disk
from edge_agent.outbox.segment import FRAME_BYTES, Frame, Gap, SegmentHeader, frame_size, header_size, read_header, scan

__all__ = ["Cursor", "Segment", "load_header"]

_READ_BYTES = 256 * 1024
_READ_TRIES = 5
_FEED_BYTES = 4 * 1024 * 1024  # more is read from the disk, as the link takes it
_PREFIX_BYTES = 16


@dataclass(slots=True)
class Segment:
    """A file of a log: `start` is where its frames begin, `end` where the accepted ones end."""

    number: int
    name: str
    header: SegmentHeader
    start: int
    end: int
    busy: bool = False  # a job rewrites it


class Segments(Protocol):
    """The log, as far as its reader cares."""

    segments: deque[Segment]

    def last_before(self, segment: Segment) -> Mapping[int, int]:
        """The newest numbers at the end of a segment, by what comes after it."""


def load_header(disk: Disk, name: str) -> tuple[SegmentHeader, int]:
    """A file's header and where its frames begin; CorruptError when it has none."""
    prefix = disk.read(name, 0, _PREFIX_BYTES)
    return read_header(disk.read(name, 0, max(header_size(prefix), _PREFIX_BYTES)))


class Cursor:
    """Walks a log's segments; `next` gives each frame once, with the bytes it takes on disk."""

    def __init__(self, disk: Disk, log: Segments) -> None:
        self._disk = disk
        self._log = log
        self._at: Segment | None = None
        self._offset = 0  # behind the last frame given
        self._read_to = 0  # behind the last byte read
        self._ready: deque[tuple[Frame, int]] = deque()
        self._seen: dict[int, int] = {}  # newest number of each stream up to here, in this segment's era
        self._failures = 0  # of reading, one after the other; at the last one what cannot be read is given up
        self.damaged = 0  # segments with damage found while reading

    def rewind(self) -> None:
        """Back to the first segment."""
        self.enter(self._log.segments[0] if self._log.segments else None)

    def reenter(self, segment: Segment) -> None:
        """A segment was rewritten: start it again if the reader is in it."""
        if self._at is segment:
            self.enter(segment)

    def grown(self) -> None:
        """A segment was added."""
        if self._at is None:
            self.rewind()

    def feed(self, segment: Segment, offset: int, frames: Sequence[Frame]) -> None:
        """These frames are on disk from `offset` on: a reader that has come so far need not read them again.

        So what is fresh is sent from memory while the link keeps up, and a card that stalls holds up nobody.
        """
        if self._at is not segment or self._read_to != offset or self._ready:
            return
        if sum(len(frame.body) for frame in frames) > _FEED_BYTES:
            return
        for frame in frames:
            self._read_to += FRAME_BYTES + len(frame.body)
            self._ready.append((frame, self._read_to))

    def passed(self, segment: Segment) -> bool:
        """Whether nothing of this segment is left to give."""
        if self._at is segment and self._offset >= segment.end and not self._ready:
            self._advance()
        return self._at is not None and self._at.number > segment.number

    def inside(self, segment: Segment) -> bool:
        """Whether the reader is in this segment."""
        return self._at is segment

    def rest_bytes(self) -> int:
        """Bytes of frames not yet given."""
        if self._at is None:
            return 0
        rest = self._at.end - self._offset
        for segment in reversed(self._log.segments):
            if segment is self._at:
                break
            rest += segment.end - segment.start
        return rest

    def next(self) -> tuple[Segment, Frame, int] | None:
        """The next frame, None at the end or while its segment is being rewritten."""
        while self._at is not None:
            if self._at.busy:
                return None
            if not self._ready and not self._fill():
                if not self._advance():
                    return None
                continue
            frame, end = self._ready.popleft()
            size, self._offset = end - self._offset, end
            self._seen[frame.stream_id] = frame.last_seq
            return self._at, frame, size
        return None

    def enter(self, segment: Segment | None) -> None:
        """Stand at the beginning of a segment."""
        self._at = segment
        self._ready.clear()
        if segment is not None:
            self._offset = self._read_to = segment.start
            self._seen = dict(segment.header.last)

    def _advance(self) -> bool:
        """Go to the next segment, if there is one."""
        listed = list(self._log.segments)
        index = next((i for i, segment in enumerate(listed) if segment is self._at), len(listed))
        if index + 1 >= len(listed):
            return False
        before, seen = self._at, self._seen
        follower = listed[index + 1]
        self.enter(follower)
        if before is not None and before.header.era == follower.header.era:
            self._declare(seen, follower.header.last, follower.start)  # a file between the two was lost
        return True

    def _fill(self) -> bool:
        """Read on; False at the segment's end."""
        assert self._at is not None
        wanted = _READ_BYTES
        while self._read_to < self._at.end:
            rest = self._at.end - self._read_to
            try:
                data = self._disk.read(self._at.name, self._read_to, min(wanted, rest))
            except DiskError:
                self._failures += 1
                if self._failures < _READ_TRIES:
                    raise
                return self._skip_damage()
            self._failures = 0
            found = scan(data)
            if found.frames:
                self._ready.extend(
                    (frame, self._read_to + end) for frame, end in zip(found.frames, found.ends, strict=True)
                )
                self._read_to += found.ends[-1]
                return True
            if found.state == "torn" and len(data) < rest and frame_size(data, 0) <= rest:
                wanted = max(frame_size(data, 0), 2 * wanted)  # a frame larger than what was read
                continue
            return self._skip_damage()
        return False

    def _skip_damage(self) -> bool:
        """Give gaps for what cannot be read of this segment, by the numbers of the next; False when none is missing."""
        assert self._at is not None
        self._failures = 0
        self.damaged += 1
        segment, self._read_to = self._at, self._at.end
        self._declare(self._seen, self._log.last_before(segment), segment.end)
        if not self._ready:
            self._offset = segment.end
        return bool(self._ready)

    def _declare(self, seen: Mapping[int, int], last: Mapping[int, int], offset: int) -> None:
        """Have gaps ready for the numbers between these."""
        for stream, last_seq in last.items():
            first_seq = seen.get(stream, 0) + 1
            if last_seq >= first_seq:
                gap = Gap(first_seq, last_seq, "disk_corrupt", 0, 0)
                self._ready.append((Frame.of_gap(stream, gap, wall_ns=0, mono_ns=0), offset))
