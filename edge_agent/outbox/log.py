"""One log of the outbox: segments on disk, appended at the tail, read in order, acknowledged and deleted at the head.

The event loop owns a log. What touches the disk for long is a job: made here, run on any thread, then applied here.
Only one job of a log is under way at a time. Invariant: for each stream of an era, what was acknowledged, the frames
that are held and the gaps among them make 1 .. last, disjoint.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from edge_agent.errors import CorruptError
from edge_agent.outbox.disk import Disk
from edge_agent.outbox.reader import Cursor, Segment, load_header
from edge_agent.outbox.rewrite import RewriteJob
from edge_agent.outbox.segment import Frame, Scan, SegmentHeader, header_is_cut, pack_frame, pack_header, scan

__all__ = ["AppendJob", "Flight", "Key", "SegmentLog", "Taken"]

Key = tuple[int, int]  # era, stream
_SHRINK_BYTES = 1024 * 1024  # an acknowledged tail of this size makes room


class Taken(NamedTuple):
    """A frame to send, and the era it belongs to."""

    era: int
    frame: Frame


class Flight(NamedTuple):
    """A frame that was taken and is not acknowledged."""

    segment: int
    key: Key
    last_seq: int
    size_bytes: int


@dataclass(slots=True)
class AppendJob:
    """Frames on their way to the disk: one write and one sync. `run` on any thread, then `SegmentLog.appended`."""

    disk: Disk
    segment: Segment
    offset: int
    data: bytes
    frames: Sequence[Frame]

    def run(self) -> None:
        """Raises DiskError and leaves nothing behind."""
        self.disk.append(self.segment.name, self.offset, self.data)


class SegmentLog:
    """A first-in first-out queue of frames that survives crashes."""

    def __init__(self, name: str, disk: Disk, *, segment_bytes: int, boot_id: str = "") -> None:
        self.name = name
        self.segments: deque[Segment] = deque()
        self.last: dict[int, int] = {}  # of the present era
        self.acked: dict[Key, int] = {}
        self.garbage: list[str] = []  # files that nobody needs any more; the writer removes them
        self.flight: deque[Flight] = deque()
        self.flight_bytes = 0
        self._disk = disk
        self._segment_bytes = segment_bytes
        self._boot_id = boot_id
        self._ends: dict[int, dict[int, int]] = {}  # the newest numbers of eras that are over
        self._cursor = Cursor(disk, self)
        self._roll = False
        self._next_number = 1

    # -- the life of the log ----------------------------------------------------------------------------------------

    def open(self, era: int) -> bool:
        """Read what is there; False when numbers may be missing at its end, so that the era must change.

        A frame that is only half there was being written when the program died, and was never sent. A damaged one, or
        anything behind it, may have been: its numbers must not be given again.
        """
        sound = True
        for name in self._disk.names(self.name):
            size = self._disk.size(name)
            number = int(name.rpartition("/")[2].partition(".")[0])
            self._next_number = number + 1  # also after a file that is to be removed
            try:
                header, start = load_header(self._disk, name)
            except CorruptError:
                sound = sound and header_is_cut(self._disk.read(name, 0, size))
                self.garbage.append(name)
                continue
            self.segments.append(Segment(number, name, header, start, size))
        for segment, after in self._pairs():
            if after is None or after.header.era != segment.header.era:
                sound = self._close_era(segment) and sound
        self.last = dict(self._ends.pop(era, {}))
        self._roll = not sound
        self._cursor.rewind()
        return sound

    def begin_era(self, era_before: int) -> None:
        """Numbers start at 1 again, under the next era, with the next append."""
        self._ends[era_before] = self.last
        self.last = {}
        self._roll = True

    def begin_segment(self) -> None:
        """The last one has failed: write no more into it."""
        self._roll = True

    def rewind(self, marks: Mapping[Key, int]) -> None:
        """Take everything again that lies after these marks (0 where there is none)."""
        self.flight.clear()
        self.flight_bytes = 0
        self.acked = {key: marks.get(key, 0) for key in self.streams()}
        self._cursor.rewind()

    # -- writing ----------------------------------------------------------------------------------------------------

    def append_job(self, frames: Sequence[Frame], *, era: int) -> AppendJob:
        """The job that writes these frames, in a new segment where the last one is full."""
        data = b"".join(map(pack_frame, frames))
        tail = self.segments[-1] if self.segments else None
        if tail is None or self._roll or tail.header.era != era or self._is_full(tail, len(data)):
            number = self._next_number
            header = SegmentHeader(era=era, boot_id=self._boot_id, last=dict(self.last))
            head = pack_header(header)
            segment = Segment(number, f"{self.name}/{number:012d}.seg", header, len(head), 0)
            return AppendJob(self._disk, segment, 0, head + data, frames)
        return AppendJob(self._disk, tail, tail.end, data, frames)

    def appended(self, job: AppendJob) -> None:
        """The job was run: its frames are accepted."""
        if job.offset == 0:
            self.segments.append(job.segment)
            self._next_number = job.segment.number + 1
            self._roll = False
            self._cursor.grown()
        job.segment.end = job.offset + len(job.data)
        self.last.update({frame.stream_id: frame.last_seq for frame in job.frames})
        self._cursor.feed(job.segment, job.offset or job.segment.start, job.frames)
        self._collect()

    # -- making room ------------------------------------------------------------------------------------------------

    def rewrite_job(self, *, thin: bool, wall_ns: int) -> RewriteJob | None:
        """The job that thins out or drops the oldest segment that can be; None when there is none.

        The last segment is never one: the next append then starts another, so that it can be the time after.
        """
        before: Segment | None = None
        for segment, after in self._pairs():
            if after is None:
                self._roll = self._roll or segment.end > segment.start
                return None
            if segment.busy or segment.header.rewritten == "dropped" or (thin and segment.header.rewritten):
                before = segment if segment.header.rewritten == "dropped" and not segment.busy else None
                continue
            segment.busy = True
            joins = before is not None and not thin and before.header.era == segment.header.era
            if joins and before is not None:
                before.busy = True
            era = segment.header.era
            return RewriteJob(
                disk=self._disk,
                segment=segment,
                before=before if joins else None,
                last=dict(self.last_before(segment)),
                acked={stream: seq for (of, stream), seq in self.acked.items() if of == era},
                thin=thin,
                wall_ns=wall_ns,
            )
        return None

    def rewritten(self, job: RewriteJob, *, done: bool) -> None:
        """The job was run; where it failed nothing has changed."""
        job.segment.busy = False
        if job.before is not None:
            job.before.busy = False
        if not done:
            return
        segment = job.segment
        segment.header, segment.start, segment.end = job.header, job.start, job.end
        if job.before is not None:
            self.garbage.append(job.before.name)
            if self._cursor.inside(job.before):
                self._cursor.enter(segment)
            self.segments.remove(job.before)
        self._cursor.reenter(segment)  # what of it is in flight stays so: the gap is needed until that is acknowledged
        self._collect()

    # -- reading ----------------------------------------------------------------------------------------------------

    def take(self) -> Taken | None:
        """The next frame that is not acknowledged, now in flight; None while there is none."""
        while (found := self._cursor.next()) is not None:
            segment, frame, size = found
            key = (segment.header.era, frame.stream_id)
            if frame.last_seq > self.acked.get(key, 0):
                self.flight.append(Flight(segment.number, key, frame.last_seq, size))
                self.flight_bytes += size
                return Taken(segment.header.era, frame)
            self._collect()
        self._collect()
        return None

    def acknowledge(self, era: int, stream_id: int, seq: int) -> None:
        """The gateway has everything of a stream up to `seq`."""
        key = (era, stream_id)
        self.acked[key] = max(self.acked.get(key, 0), seq)
        while self.flight and self.acked.get(self.flight[0].key, 0) >= self.flight[0].last_seq:
            self.flight_bytes -= self.flight.popleft().size_bytes
        self._collect()

    # -- what it holds ----------------------------------------------------------------------------------------------

    @property
    def size_bytes(self) -> int:
        """Bytes on disk."""
        return sum(segment.end for segment in self.segments)

    @property
    def waiting_bytes(self) -> int:
        """Bytes that were not taken yet."""
        return self._cursor.rest_bytes()

    @property
    def empty(self) -> bool:
        """Whether everything that was accepted is acknowledged."""
        return not self.flight and self._cursor.rest_bytes() == 0

    def streams(self) -> list[Key]:
        """Every stream it holds or numbers, with its era."""
        eras = dict.fromkeys(segment.header.era for segment in self.segments)
        present = self.segments[-1].header.era if self.segments else 0
        return [(era, stream) for era in eras for stream in self.last_of(era, present)]

    def last_of(self, era: int, present: int) -> Mapping[int, int]:
        """The newest numbers of an era."""
        return self._ends.get(era, {}) if era != present or era in self._ends else self.last

    def first_held(self, era: int, stream_id: int) -> int:
        """The oldest number of a stream that is still on disk."""
        for segment in self.segments:
            if segment.header.era == era:
                return segment.header.last.get(stream_id, 0) + 1
        return self.last.get(stream_id, 0) + 1

    def last_before(self, segment: Segment) -> Mapping[int, int]:
        """The newest numbers at the end of a segment, by what comes after it."""
        for one, after in self._pairs():
            if one is segment and after is not None and after.header.era == segment.header.era:
                return after.header.last
        return self._ends.get(segment.header.era, self.last)

    # -- inside -----------------------------------------------------------------------------------------------------

    def _pairs(self) -> Iterator[tuple[Segment, Segment | None]]:
        listed = list(self.segments)
        return zip(listed, [*listed[1:], None], strict=False)  # empty where there is no segment

    def _close_era(self, segment: Segment) -> bool:
        """Learn an era's newest numbers from its last segment, and cut off what is half written."""
        found: Scan = scan(self._disk.read(segment.name, 0, segment.end), segment.start)
        newest = {**segment.header.last, **segment.header.until}
        for frame in found.frames:
            newest[frame.stream_id] = max(newest.get(frame.stream_id, 0), frame.last_seq)
        self._ends[segment.header.era] = newest
        segment.end = found.end(segment.start)
        return found.state != "corrupt"

    def _is_full(self, tail: Segment, more: int) -> bool:
        if tail.busy or tail.header.rewritten:
            return True
        held = tail.end - tail.start
        if self.empty:
            return held > _SHRINK_BYTES
        return held > 0 and tail.end + more > self._segment_bytes

    def _collect(self) -> None:
        """Let go of segments at the head that are read and acknowledged; the last one keeps the numbers."""
        while len(self.segments) > 1 and not self.segments[0].busy:
            head = self.segments[0]
            if not self._cursor.passed(head) or (self.flight and self.flight[0].segment <= head.number):
                return
            self.segments.popleft()
            self.garbage.append(head.name)
            if head.header.era != self.segments[0].header.era:
                self._ends.pop(head.header.era, None)
