"""Recordings on the back-fill lane: offered at each session's start, sent from where the gateway wants them. Pure.

They are outside the streams: no watermarks, no pause by RetryLater. What the gateway has on its disk is the only
progress; when it reports an offset that is no progress, it dropped something, and sending begins there again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from edge_agent.blackbox.recording_store import RecordingStore, SavedRecording
from edge_agent.errors import DiskError
from edge_agent.link.budget import Budget
from metaros._proto import link_pb2
from metaros.limits import LIMITS, Limits

__all__ = ["RecordingUpload"]

_PART_S: Final = 0.1  # a part is no longer than what back-fill may send in this time,
_LEAST_PART_BYTES: Final = 4096  # but not smaller than that


@dataclass(slots=True)
class _Flow:
    """One recording that the gateway wants: `acknowledged` is on its disk, up to `position` it was sent."""

    acknowledged: int
    position: int
    sent: deque[tuple[int, float]] = field(default_factory=deque)  # end of each part, when


class RecordingUpload:
    """One session's upload state of all stored recordings."""

    def __init__(self, recordings: RecordingStore, budget: Budget, *, limits: Limits = LIMITS) -> None:
        self._recordings, self._budget, self._limits = recordings, budget, limits
        self._offered: dict[str, str] = {}  # id to the code that it was offered with
        self._flows: dict[str, _Flow] = {}

    def offers(self) -> Iterator[link_pb2.RecordingPart]:
        """What the gateway does not know of yet in this session."""
        for saved in self._recordings:
            if self._offered.get(saved.recording_id) != saved.failed:
                self._offered[saved.recording_id] = saved.failed
                yield offer(saved)

    def wanted(self, wanted: link_pb2.RecordingWanted, now_s: float) -> None:
        """The gateway said what it has, or that it is done with a recording."""
        saved = self._recordings.get(wanted.recording_id)
        if wanted.stored or wanted.unwanted:
            flow = self._flows.pop(wanted.recording_id, None)
            if flow is not None and saved is not None and wanted.stored:
                self._freed(flow, saved.size_bytes, now_s)
            self._recordings.remove(wanted.recording_id)
            return
        if saved is None or saved.failed or wanted.offset > saved.size_bytes:
            return
        flow = self._flows.get(wanted.recording_id)
        if flow is None:
            self._flows[wanted.recording_id] = _Flow(wanted.offset, wanted.offset)
        elif wanted.offset > flow.acknowledged:
            self._freed(flow, wanted.offset, now_s)
            flow.acknowledged, flow.position = wanted.offset, max(flow.position, wanted.offset)
        else:
            flow.acknowledged = flow.position = wanted.offset
            flow.sent.clear()

    def ready(self) -> bool:
        """Whether `next` has a part."""
        return self._choice() is not None

    def next(self, now_s: float) -> link_pb2.RecordingPart | None:
        """The next part, oldest recording first; one that cannot be read is reported as failed."""
        found = self._choice()
        if found is None:
            return None
        saved, flow, size = found
        try:
            data = self._recordings.read(saved.recording_id, flow.position, size)
        except DiskError:
            del self._flows[saved.recording_id]
            self._recordings.fail(saved.recording_id, "damaged")
            return next(self.offers(), None)
        part = link_pb2.RecordingPart(
            recording_id=saved.recording_id,
            offset=flow.position,
            data=data,
            size_bytes=saved.size_bytes,
            sha256=bytes.fromhex(saved.sha256),
        )
        flow.position += size
        flow.sent.append((flow.position, now_s))
        self._budget.backfill_taken(size, now_s)
        return part

    def _choice(self) -> tuple[SavedRecording, _Flow, int] | None:
        """The recording whose turn it is, and how much of it goes next."""
        room = self._limits.recording_window_bytes - sum(
            flow.position - flow.acknowledged for flow in self._flows.values()
        )
        for saved in self._recordings if self._flows else ():
            flow = self._flows.get(saved.recording_id)
            if flow is not None and flow.position < saved.size_bytes:
                size = min(self._part_bytes(), saved.size_bytes - flow.position)
                return (saved, flow, size) if size <= room else None
        return None

    def _part_bytes(self) -> int:
        """So large that one part does not hold up the lane, or the budget, for long."""
        rate = int(self._budget.backfill_bytes_per_s * _PART_S)
        return min(self._limits.recording_part_bytes, max(_LEAST_PART_BYTES, rate))

    def _freed(self, flow: _Flow, offset: int, now_s: float) -> None:
        """The gateway has so much: what the link carried, for the budget."""
        delay_s = 0.0
        while flow.sent and flow.sent[0][0] <= offset:
            delay_s = now_s - flow.sent.popleft()[1]
        if (freed := min(offset, flow.position) - flow.acknowledged) > 0:
            self._budget.backfilled(freed, now_s, delay_s=delay_s)


def offer(saved: SavedRecording) -> link_pb2.RecordingPart:
    """What is there, without data."""
    return link_pb2.RecordingPart(
        recording_id=saved.recording_id,
        size_bytes=saved.size_bytes,
        sha256=bytes.fromhex(saved.sha256),
        from_ns=saved.from_ns,
        to_ns=saved.to_ns,
        messages=saved.messages,
        failed=saved.failed,
    )
