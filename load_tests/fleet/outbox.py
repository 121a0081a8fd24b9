"""A robot's outbox in memory: what the agent's session asks of one, without the disk.

Numbers, classes, back-fill streams, resends and declared losses are those of `edge_agent.outbox`; what it lacks is the
disk: a sample is accepted when it is handed over. One stream a log, which is all that a simulated robot has.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from edge_agent.errors import BehindError
from edge_agent.outbox import LOGS, Depth, Frame, Gap, Kind, StreamRange, Taken
from edge_agent.outbox.classes import BACKFILL_BIT, LogName, log_name

__all__ = ["Log", "MemoryOutbox", "MemoryState"]

ERA = 1
LOG_FRAME_BYTES = 128  # what a frame costs beside its body


@dataclass(slots=True)
class Log:
    """One stream's frames that are not acknowledged; the first `sent` of them are under way."""

    stream_id: int
    held: deque[Frame] = field(default_factory=deque)
    sent: int = 0
    last: int = 0
    acked: int = 0
    size_bytes: int = 0


@dataclass(slots=True)
class MemoryState:
    """The part of OutboxState that a session reads."""

    writers: list[str]
    epochs: dict[int, int]


class MemoryOutbox:
    """Logs come into being with their first sample: an idle robot has none."""

    def __init__(self, *, epoch: int, writer: str, quota_bytes: int, on_stored: Callable[[Frame], None]) -> None:
        """`on_stored` hears of every frame that the gateway acknowledged."""
        self.state = MemoryState([writer], {ERA: epoch})
        self.live_epoch = epoch
        self.online = False
        self.free_bytes = 0
        self.lost = {"event": 0, "metric": 0, "bulk": 0}
        self.logs: dict[LogName, Log] = {}
        self._quota_bytes = quota_bytes
        self._on_stored = on_stored

    def append(self, delivery: str, stream_id: int, kind: Kind, count: int, body: bytes, *, now_ns: int) -> int:
        """Number and keep a run of samples or rows; the first number. Over the quota they become a declared loss."""
        backfill = not self.online and delivery != "event"
        name = log_name(delivery, backfill=backfill)
        log = self.logs.get(name)
        if log is None:
            log = self.logs[name] = Log(stream_id | BACKFILL_BIT if backfill else stream_id)
        first = log.last + 1
        log.last += count
        if log.size_bytes + len(body) > self._quota_bytes:
            self._lose(log, first, now_ns)
            self.lost[delivery] += count
            return first
        log.held.append(Frame(kind, log.stream_id, first, count, now_ns, 0, body))
        log.size_bytes += len(body) + LOG_FRAME_BYTES
        return first

    @property
    def waiting(self) -> int:
        """Frames that nobody acknowledged."""
        return sum(len(log.held) for log in self.logs.values())

    # -- what a session asks ----------------------------------------------------------------------------------------

    def quota_bytes(self, delivery: str) -> int:
        """The most that a log may hold."""
        return self._quota_bytes

    def ranges(self, names: Iterable[LogName] = LOGS) -> list[StreamRange]:
        """Every stream of these logs, for a Hello."""
        found = ((self.logs[name]) for name in names if name in self.logs)
        return [StreamRange(log.stream_id, self.live_epoch, log.acked + 1, log.last, 0) for log in found]

    def resume(self, marks: Mapping[tuple[int, int], int], writers: Mapping[int, str] = MappingProxyType({})) -> None:
        """A new session: send all after the gateway's watermarks. Raises BehindError where it has what never was."""
        for log in self.logs.values():
            mark = marks.get((self.live_epoch, log.stream_id), 0)
            if mark > log.last:
                raise BehindError(f"the gateway has {mark} of stream {log.stream_id}, {log.last} were given")
            self._stored(log, mark)
            log.sent = 0

    def writers_stored(self, stored: Collection[str]) -> None:
        """There is one writer."""

    def restart(self, names: Iterable[LogName]) -> None:
        """Send again what nobody acknowledged."""
        for name in names:
            if name in self.logs:
                self.logs[name].sent = 0

    def take(self, name: LogName) -> Taken | None:
        """The next frame of a log to send."""
        log = self.logs.get(name)
        if log is None or log.sent >= len(log.held):
            return None
        log.sent += 1
        return Taken(ERA, log.held[log.sent - 1])

    def epoch_of(self, era: int) -> int:
        """There is one."""
        return self.live_epoch

    def acknowledge(self, stream_id: int, epoch: int, seq: int) -> None:
        """The gateway has a stream up to `seq`."""
        for log in self.logs.values():
            if log.stream_id == stream_id:
                self._stored(log, seq)

    def depth(self, delivery: str) -> Depth:
        """How much of a class waits."""
        fresh = self.logs.get(delivery)
        late = self.logs.get(log_name(delivery, backfill=True)) if delivery != "event" else None
        sizes = [log.size_bytes if log is not None else 0 for log in (fresh, late)]
        samples = sum(log.last - log.acked for log in (fresh, late) if log is not None)
        return Depth(sizes[0], sizes[1], samples, sum(sizes))

    # -- within -----------------------------------------------------------------------------------------------------

    def _stored(self, log: Log, seq: int) -> None:
        log.acked = max(log.acked, seq)
        while log.held and log.held[0].last_seq <= seq:
            frame = log.held.popleft()
            log.size_bytes -= len(frame.body) + LOG_FRAME_BYTES
            log.sent = max(0, log.sent - 1)
            self._on_stored(frame)

    def _lose(self, log: Log, first: int, now_ns: int) -> None:
        """A gap in their place; it joins the one before it unless that is under way."""
        last = log.held[-1] if len(log.held) > log.sent else None
        if last is not None and last.kind is Kind.GAP:
            log.held.pop()
            gap = Gap(last.first_seq, log.last, "outbox_full", last.gap().from_ns, now_ns)
            log.size_bytes -= len(last.body) + LOG_FRAME_BYTES
        else:
            gap = Gap(first, log.last, "outbox_full", now_ns, now_ns)
        frame = Frame.of_gap(log.stream_id, gap, wall_ns=now_ns, mono_ns=0)
        log.held.append(frame)
        log.size_bytes += len(frame.body) + LOG_FRAME_BYTES
