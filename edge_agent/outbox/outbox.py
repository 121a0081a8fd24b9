"""The outbox: what was accepted and not yet acknowledged, on disk, one or two logs a class.

A sample is gathered, numbered and packed with its neighbours, written and synced; only then is it accepted and may be
sent. Numbers start at 1 in a random epoch and have no holes: what could not be kept is a gap in its place. While the
link is down metrics and bulk go to a second log, under a second stream (`BACKFILL_BIT`), so that what is fresh after
an outage goes out first.

The event loop owns everything here. Jobs are made here, run on the writer's thread, and applied here; at most one of
a log is under way.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from edge_agent.errors import BehindError, DiskError, DiskFullError
from edge_agent.outbox.classes import BACKFILL_BIT, CLASSES, LOGS, ClassPolicy, LogName, log_name
from edge_agent.outbox.disk import Disk
from edge_agent.outbox.ids import IdLog
from edge_agent.outbox.log import AppendJob, SegmentLog, Taken
from edge_agent.outbox.pending import Lost, Pending, Row, Sample, Seal, pack
from edge_agent.outbox.rewrite import RewriteJob, with_room
from edge_agent.outbox.state import OutboxState
from metaros.clock import Clock
from metaros.errors import FrameError
from metaros.limits import LIMITS, Limits
from metaros.link import CHANNEL_MASK

__all__ = ["Depth", "FlushJob", "Outbox", "StreamRange"]

RESERVE = "reserve"
_RETRY_S = 0.5
_GATHER_BYTES = 64 * 1024 * 1024  # of all logs, while the disk is slow; a log with its share of it loses what comes


class StreamRange(NamedTuple):
    """What a Hello says of a stream."""

    stream_id: int
    epoch: int
    first_seq: int
    last_seq: int
    base_seq: int  # numbers up to here are of an earlier epoch


class Depth(NamedTuple):
    """How much of a class waits."""

    fresh_bytes: int
    backfill_bytes: int
    samples: int
    disk_bytes: int


class FlushJob(NamedTuple):
    """An append on its way, and what it is made of, should it fail."""

    log: LogName
    append: AppendJob
    streams: dict[int, list[Sample | Lost]]


class Outbox:
    """All logs of one directory. `new_epoch` gives 64 random bits; `writer` names this process for ever."""

    def __init__(
        self,
        disk: Disk,
        clock: Clock,
        *,
        new_epoch: Callable[[], int],
        writer: str,
        boot_id: str = "",
        classes: Mapping[str, ClassPolicy] = CLASSES,
        reserve_bytes: int = LIMITS.outbox_reserve_bytes,
        limits: Limits = LIMITS,
    ) -> None:
        """Reads the directory; raises DiskError where that, or the first write, fails."""
        self._disk = disk
        self._clock = clock
        self._new_epoch = new_epoch
        self._classes = dict(classes)
        self._limits = limits
        self._reserve_bytes = reserve_bytes
        self.online = False  # whether the link is up, so that what comes is fresh
        self.seal: Seal | None = None  # what is kept of a payload once it has its number
        self.on_accepted: Callable[[Mapping[int, list[Sample | Lost]]], None] = lambda streams: None
        self._note_at_s = 0.0
        self._pending = {name: Pending(limits) for name in LOGS}
        self._writing: set[LogName] = set()
        self._log_of: dict[int, LogName] = {}
        self.logs = {
            name: SegmentLog(name, disk, segment_bytes=self._segment_bytes(name), boot_id=boot_id) for name in LOGS
        }
        self.lost = dict.fromkeys(classes, 0)  # samples that became gaps since the program started
        self.writer = writer
        self.state = self._open()
        state = self.state.with_writer(writer, self._last())
        with_room(lambda: self._save(state), self)
        self.ids = IdLog(disk, held={held.stream_id & CHANNEL_MASK for held in self.ranges()} - {0})

    # -- what came in -----------------------------------------------------------------------------------------------

    @property
    def live_epoch(self) -> int:
        """The epoch of what is never stored."""
        return self.state.epochs[self.state.era]

    @property
    def free_bytes(self) -> int:
        """What the disk has left; 0 when it does not say."""
        try:
            return self._disk.free()[0]
        except DiskError:
            return 0

    def quota_bytes(self, delivery: str) -> int:
        """The most that a class may hold."""
        return self._classes[delivery].quota_bytes

    def append(self, stream_id: int, delivery: str, stamp_ns: int, data: bytes | Row, came_s: float = 0.0) -> None:
        """Gather a sample as if it came at `came_s` (0: now). It is accepted once its flush is done."""
        name, stream_id = self._route(stream_id, delivery)
        pending = self._pending[name]
        if pending.size_bytes > _GATHER_BYTES // len(LOGS) and self._gathered() > _GATHER_BYTES:
            self._lose(name, stream_id, "disk_slow")
            return
        pending.append(stream_id, (stamp_ns, data), came_s or self._clock.monotonic_s())

    def give_up(self, stream_id: int, delivery: str, reason: str) -> None:
        """Number a sample that cannot be kept: it becomes a gap."""
        self._lose(*self._route(stream_id, delivery), reason)

    def due_s(self, name: LogName) -> float | None:
        """Seconds until a log's gathering is to be flushed, 0 now, None when nothing waits or it is being written."""
        pending = self._pending[name]
        if pending.since_s is None or name in self._writing:
            return None
        policy, now_s = self._policy(name), self._clock.monotonic_s()
        if pending.size_bytes >= policy.sync_bytes and now_s >= pending.since_s:  # what failed waits for its next try
            return 0.0
        return max(0.0, pending.since_s + policy.sync_s - now_s)

    # -- to the disk ------------------------------------------------------------------------------------------------

    def flush_job(self, name: LogName) -> FlushJob | None:
        """The job that writes what a log has gathered; end it with `flushed` or `refused`."""
        pending = self._pending[name]
        if not pending or name in self._writing:
            return None
        if reason := self._no_room(name):
            self._count(pending.lose_all(reason, self._clock.wall_ns()), name)
        log, streams = self.logs[name], pending.take()
        frames = pack(
            streams,
            lambda stream: log.last.get(stream, 0) + 1,
            wall_ns=self._clock.wall_ns(),
            mono_ns=round(self._clock.monotonic_s() * 1e9),
            limits=self._limits,
            epoch=self.live_epoch,
            seal=self.seal,
            on_lost=lambda: self._count(1, name),
        )
        self._writing.add(name)
        return FlushJob(name, log.append_job(list(frames), era=self.state.era), streams)

    def flushed(self, job: FlushJob) -> None:
        """It was run: its samples are accepted."""
        self._writing.discard(job.log)
        self.logs[job.log].appended(job.append)
        self._log_of.update(dict.fromkeys(job.streams, job.log))
        self.on_accepted(job.streams)

    def refused(self, job: FlushJob, reason: str) -> None:
        """It could not be run: its samples are lost, which the next flush declares. Events wait for another try."""
        self._writing.discard(job.log)
        now_ns, now_s = self._clock.wall_ns(), self._clock.monotonic_s()
        pending = self._pending[job.log]
        if self._policy(job.log).when_full == "refuse" and self._gathered() < _GATHER_BYTES:
            pending.restore(job.streams, now_s + _RETRY_S)
        else:
            self._count(pending.put_back(job.streams, reason, now_ns, now_s), job.log)
        if reason != DiskFullError.code:
            self.logs[job.log].begin_segment()

    def room_job(self, delivery: str) -> RewriteJob | None:
        """The next job that brings a class back under its quota, None when it is."""
        names = [name for name in LOGS if name.partition("_")[0] == delivery]
        policy = self._classes[delivery]
        if policy.when_full == "refuse" or sum(self.logs[name].size_bytes for name in names) <= policy.quota_bytes:
            return None
        return self._rewrite(reversed(names), thin=policy.when_full == "thin") or self._rewrite(reversed(names))

    def relief_job(self, name: LogName) -> RewriteJob | None:
        """The disk is full: the next job that frees some of it for a write to this log, None when nothing yields."""
        victims = {"bulk": ("bulk_backfill", "bulk"), "metric": ("bulk_backfill", "bulk", "metric_backfill", "metric")}
        return self._rewrite(victims.get(name.partition("_")[0], victims["metric"]))

    def rewritten(self, job: RewriteJob, *, done: bool) -> None:
        """A room or relief job was run."""
        name = job.segment.name.partition("/")[0]
        self.logs[name].rewritten(job, done=done)
        if done:
            self._count(job.lost, name)

    def release_reserve(self) -> bool:
        """Give up the space kept for the worst; False when it was given up before."""
        if self._disk.size(RESERVE) == 0:
            return False
        self._disk.reserve(RESERVE, 0)
        return True

    def restore_reserve(self) -> None:
        """Take the space back where there is twice as much; raises DiskError."""
        if self._disk.size(RESERVE) != self._reserve_bytes and self._disk.free()[0] > 2 * self._reserve_bytes:
            self._disk.reserve(RESERVE, self._reserve_bytes)

    def sweep(self) -> list[str]:
        """Files that nobody needs any more, for the writer to remove."""
        names = [name for log in self.logs.values() for name in log.garbage]
        for log in self.logs.values():
            log.garbage.clear()
        return names

    # -- to the link ------------------------------------------------------------------------------------------------

    def ranges(self, names: Iterable[LogName] = LOGS) -> list[StreamRange]:
        """Every durable stream of these logs: the oldest number held and the newest accepted."""
        found = []
        for log in (self.logs[name] for name in names):
            for era, stream in log.streams():
                last = log.last_of(era, self.state.era).get(stream, 0)
                base = self.state.bases.get(era, {}).get(stream, 0)
                found.append(StreamRange(stream, self.state.epochs[era], log.first_held(era, stream), last, base))
        return found

    def resume(self, marks: Mapping[tuple[int, int], int], writers: Mapping[int, str] = MappingProxyType({})) -> None:
        """A new session: all after the gateway's (epoch, stream) watermarks, 0 where none is named, is to be sent.

        `writers` names the writer of each epoch that the gateway knows.

        Raises:
            BehindError: the gateway has numbers that this directory had not given when that writer ended: it is a copy
                of another one, or the disk forgot what it had synced. Everything is then under a new epoch, for the
                next session.
        """
        eras = {epoch: era for era, epoch in self.state.epochs.items()}
        own = {(eras[epoch], stream): seq for (epoch, stream), seq in marks.items() if epoch in eras}
        known = {eras[epoch]: writer for epoch, writer in writers.items() if epoch in eras}
        if (stream := self.state.overtaken(self._last(), own, known)) >= 0:
            self.relabel()
            raise BehindError(f"the gateway has more of stream {stream} than this outbox ever accepted")
        for log in self.logs.values():
            log.rewind(own)

    def restart(self, names: Iterable[LogName]) -> None:
        """Send again what these logs have sent and nobody acknowledged."""
        for name in names:
            self.logs[name].rewind(dict(self.logs[name].acked))

    def relabel(self) -> None:
        """Put everything that is held under new epochs: another outbox has spoken under the old ones.

        Raises:
            DiskError: it could not be noted; nothing has changed.
        """
        bases: dict[int, dict[int, int]] = {}
        for log in self.logs.values():
            for era, stream in log.streams():
                bases.setdefault(era, {})[stream] = log.first_held(era, stream) - 1
        self._save(self.state.relabelled(self._new_epoch, bases))

    def writers_stored(self, stored: Collection[str]) -> None:
        """The gateway's store has these writers of our epochs: those before them need not be named any more."""
        held = {segment.header.era for log in self.logs.values() for segment in log.segments}
        state = self.state.known(stored, held)
        if state != self.state:
            with contextlib.suppress(DiskError):  # then the list stays long for now
                self._save(state)

    def take(self, name: LogName) -> Taken | None:
        """The next frame of a log to send; None while there is none, or it cannot be noted that this process sends."""
        if self.state.sender != self.writer and not self._note_sender():
            return None
        return self.logs[name].take()

    def epoch_of(self, era: int) -> int:
        """The epoch under which a taken frame is known to the gateway."""
        return self.state.epochs[era]

    def acknowledge(self, stream_id: int, epoch: int, seq: int) -> None:
        """The gateway has a stream up to `seq`, sent now or earlier; FrameError for what was never accepted."""
        era = next((era for era, known in self.state.epochs.items() if known == epoch), None)
        name = self._log_of.get(stream_id)
        if era is None or name is None:
            return
        log = self.logs[name]
        last = log.last_of(era, self.state.era).get(stream_id, 0)
        if seq > last:
            if (era, stream_id) not in log.streams():
                return  # of an era that is over, and of which nothing is held
            raise FrameError(f"ack of {seq} on stream {stream_id}, accepted was {last}")
        log.acknowledge(era, stream_id, seq)

    def depth(self, delivery: str) -> Depth:
        """How much of a class waits for the link."""
        fresh, late = self.logs[delivery], self.logs[log_name(delivery, backfill=True)]
        logs = {log.name: log for log in (fresh, late)}.values()
        samples = sum(
            max(0, log.last_of(era, self.state.era).get(stream, 0) - log.acked.get((era, stream), 0))
            for log in logs
            for era, stream in log.streams()
        )
        waiting = [log.waiting_bytes + log.flight_bytes for log in logs]
        return Depth(waiting[0], sum(waiting[1:]), samples, sum(log.size_bytes for log in logs))

    def _open(self) -> OutboxState:
        state = OutboxState.load(self._disk)
        era = state.era if state is not None else 0
        opened = [log.open(era) for log in self.logs.values()]
        sound = all(opened)
        if state is None:  # it is new, or lost, and the epochs with it: what is held gets others
            held = {segment.header.era for log in self.logs.values() for segment in log.segments}
            state, sound = OutboxState({of: self._new_epoch() or 1 for of in sorted(held)}), False
        if not sound:
            state.begin_era(self._new_epoch)
            for log in self.logs.values():
                log.begin_era(era)
        for name, log in self.logs.items():
            self._log_of.update({stream: name for _, stream in log.streams()})
        return state

    def _note_sender(self) -> bool:
        now_s = self._clock.monotonic_s()
        if now_s >= self._note_at_s:
            self._note_at_s = now_s + _RETRY_S
            with contextlib.suppress(DiskError):
                self._save(replace(self.state, sender=self.writer))
        return self.state.sender == self.writer

    def _last(self) -> dict[int, dict[int, int]]:
        """Era -> stream -> the newest number there is."""
        found: dict[int, dict[int, int]] = {}
        for log in self.logs.values():
            for era, stream in log.streams():
                found.setdefault(era, {})[stream] = log.last_of(era, self.state.era).get(stream, 0)
        return found

    def _save(self, state: OutboxState) -> None:
        """Save a new state, with the reserve's space where there is no other, and only then go by it."""
        try:
            state.save(self._disk)
        except DiskFullError:
            if not self.release_reserve():
                raise
            state.save(self._disk)
        self.state = state

    def _segment_bytes(self, name: LogName) -> int:
        return min(self._limits.outbox_segment_bytes, max(64 * 1024, self._policy(name).quota_bytes // 8))

    def _policy(self, name: LogName) -> ClassPolicy:
        return self._classes[name.partition("_")[0]]

    def _route(self, stream_id: int, delivery: str) -> tuple[LogName, int]:
        if self.online or delivery == "event":
            return delivery, stream_id
        return log_name(delivery, backfill=True), stream_id | BACKFILL_BIT

    def _lose(self, name: LogName, stream_id: int, reason: str) -> None:
        self._pending[name].lose(stream_id, reason, self._clock.wall_ns(), self._clock.monotonic_s())
        self._count(1, name)

    def _gathered(self) -> int:
        return sum(pending.size_bytes for pending in self._pending.values())

    def _count(self, samples: int, name: LogName) -> None:
        self.lost[name.partition("_")[0]] += samples

    def _no_room(self, name: LogName) -> str:
        """Why nothing more may be accepted in a log now, or nothing."""
        policy = self._policy(name)
        if policy.when_full == "refuse":
            more = self._pending[name].size_bytes
            return "outbox_full" if self.logs[name].size_bytes + more > policy.quota_bytes else ""
        try:
            free, total = self._disk.free()
        except DiskError:  # the write will say so
            return ""
        return "disk_low" if free < min(policy.floor_bytes, policy.floor_share * total) else ""

    def _rewrite(self, names: Iterable[LogName], *, thin: bool = False) -> RewriteJob | None:
        for name in names:
            if (job := self.logs[name].rewrite_job(thin=thin, wall_ns=self._clock.wall_ns())) is not None:
                return job
        return None
