"""Making room: a segment is thinned out or dropped by putting a smaller file in its place, which names what is lost.

The rename is the moment at which samples become a declared gap: before it they are all there, after it the gap is.
A dropped segment is a few bytes; the one before it, if dropped too, is joined with it, so that a long outage leaves
one small file and not thousands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

from edge_agent.errors import DiskFullError
from edge_agent.outbox.classes import LogName
from edge_agent.outbox.disk import Disk
from edge_agent.outbox.reader import Segment
from edge_agent.outbox.segment import Frame, Gap, Kind, SegmentHeader, pack_frame, pack_header, scan

__all__ = ["KEEP_ONE_IN", "RewriteJob", "SpaceReclaimer", "with_room"]

KEEP_ONE_IN = 10
BLOCK_BYTES = 4096  # what a file takes of a disk


@dataclass(slots=True, kw_only=True)
class RewriteJob:
    """One segment's rewriting: `run` on any thread, then `SegmentLog.rewritten`."""

    disk: Disk
    segment: Segment
    before: Segment | None  # a dropped segment to join with
    last: Mapping[int, int]  # each stream's newest number at the segment's end
    acked: Mapping[int, int]
    thin: bool
    wall_ns: int
    header: SegmentHeader = field(init=False)
    start: int = field(init=False)
    end: int = field(init=False)
    lost: int = 0  # samples that became a gap by this job
    _sound: bool = True

    def run(self) -> None:
        """Raises DiskError; the old file is then still whole."""
        self._put(self._content())

    def cut(self) -> bool:
        """The same where not even a small file finds space: empty the old one first; False where that gives too little.

        A crash in between leaves a file without its end, which is found and declared when it is read. Raises DiskError.
        """
        data = self._content()
        if (self.segment.end - self.segment.start) // BLOCK_BYTES < -(-len(data) // BLOCK_BYTES):
            return False
        self.disk.append(self.segment.name, self.segment.start, b"")
        self._put(data)
        return True

    def _put(self, data: bytes) -> None:
        self.disk.replace(self.segment.name, data)
        self.end = len(data)

    def _content(self) -> bytes:
        """The new file."""
        self.lost, segment = 0, self.segment
        found = scan(self.disk.read(segment.name, 0, segment.end), segment.start)
        self._sound = found.state == "clean"
        first = self.before.header if self.before is not None else segment.header
        frames = list(self._thinned(found.frames)) if self.thin else list(self._gaps(found.frames, first.last))
        self.header = replace(first, until=self.last, rewritten="thinned" if self.thin else "dropped")
        head = pack_header(self.header)
        self.start = len(head)
        return head + b"".join(map(pack_frame, frames))

    def _gaps(self, frames: list[Frame], first: Mapping[int, int]) -> Iterator[Frame]:
        """One gap a stream, over everything the segment, and the dropped one before it, stood for."""
        since = {frame.stream_id: frame.wall_ns for frame in reversed(frames)}
        until = {frame.stream_id: frame.wall_ns for frame in frames}
        for stream, last_seq in self.last.items():
            from_seq = first.get(stream, 0) + 1  # also what is acknowledged: the epoch may change
            if last_seq < from_seq:
                continue
            own_seq = max(self.segment.header.last.get(stream, 0), self.acked.get(stream, 0))
            self.lost += max(0, last_seq - own_seq)
            gap = Gap(
                from_seq, last_seq, "outbox_full", since.get(stream, self.wall_ns), until.get(stream, self.wall_ns)
            )
            yield Frame.of_gap(stream, gap, wall_ns=self.wall_ns, mono_ns=0)

    def _thinned(self, frames: list[Frame]) -> Iterator[Frame]:
        """Every tenth frame of a stream as it is, and gaps in the place of the others."""
        counts: dict[int, int] = {}
        open_gaps: dict[int, Gap] = {}
        for frame in frames:
            stream = frame.stream_id
            acked = frame.last_seq <= self.acked.get(stream, 0)
            place = counts[stream] = counts.get(stream, -1) + (not acked)
            if frame.kind is not Kind.GAP and (acked or place % KEEP_ONE_IN):
                self.lost += 0 if acked else frame.count
                begun = open_gaps.get(stream)
                from_seq, from_ns = (begun.from_seq, begun.from_ns) if begun else (frame.first_seq, frame.wall_ns)
                open_gaps[stream] = Gap(from_seq, frame.last_seq, "thinned", from_ns, frame.wall_ns)
                continue
            if stream in open_gaps:
                yield Frame.of_gap(stream, open_gaps.pop(stream), wall_ns=self.wall_ns, mono_ns=0)
            yield frame
        for stream, gap in open_gaps.items():
            yield Frame.of_gap(stream, gap, wall_ns=self.wall_ns, mono_ns=0)
        if not self._sound:
            yield from self._unreadable(frames)

    def _unreadable(self, frames: list[Frame]) -> Iterator[Frame]:
        """What damage hides of the segment, by the numbers at its end."""
        seen = dict(self.segment.header.last) | {frame.stream_id: frame.last_seq for frame in frames}
        for stream, last_seq in self.last.items():
            from_seq = seen.get(stream, 0) + 1
            if last_seq >= from_seq:
                self.lost += max(0, last_seq - max(from_seq - 1, self.acked.get(stream, 0)))
                gap = Gap(from_seq, last_seq, "disk_corrupt", 0, 0)
                yield Frame.of_gap(stream, gap, wall_ns=self.wall_ns, mono_ns=0)


class SpaceReclaimer(Protocol):
    """Who has something to give up on a full disk."""

    def relief_job(self, name: LogName) -> RewriteJob | None:
        """The next job that frees some of it, None when nothing yields."""

    def rewritten(self, job: RewriteJob, *, done: bool) -> None:
        """It was run."""


def with_room(save: Callable[[], None], yields: SpaceReclaimer) -> None:
    """Save, if need be in the place of the oldest samples that may go. Raises DiskError when none is left."""
    passed: list[RewriteJob] = []
    try:
        while True:
            try:
                return save()
            except DiskFullError:
                job = yields.relief_job("event")
                if job is None:
                    raise
                if job.cut():
                    yields.rewritten(job, done=True)
                else:
                    passed.append(job)  # as long as it is not given back, the next one is told
    finally:
        for job in passed:
            yields.rewritten(job, done=False)
