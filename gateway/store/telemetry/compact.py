"""Compaction: received batches of a robot become one object, and at no moment are their samples there twice or not.

The steps of one segment, each of which may be the last that happens:
    1. batches are read, in one snapshot, and packed;
    2. the object is announced in the ledger, committed;
    3. it is put;
    4. one transaction finds exactly those batches again, deletes them, inserts the segment with its runs and marks the
       object stored.
Until 4 is committed the batches are what is stored, and the object is one that the ledger's sweep deletes. Whether a
commit happened of which nobody knows is for the ledger to say: the object is given up only where it is still being
uploaded. Two gateways that compact the same batches disturb each other in step 4 and nowhere else: the second finds
other batches than it read, and gives its object up.
"""

from __future__ import annotations

import io
import logging
import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gateway.errors import PurgedError, StoreError
from gateway.store.engine import Row, StoreEngine, placeholders, signed, slices, unsigned
from gateway.store.ledger import Transact, announce, doom, stored
from gateway.store.objects import ObjectStore
from gateway.store.telemetry.samples import CHANNEL_COLUMNS, StoredBatch, stored_channel
from gateway.store.telemetry.segments import Packed, Segment, pack
from metaros.clock import Clock

__all__ = ["CompactPace", "Compaction", "Due"]

log = logging.getLogger(__name__)

_DUE = """
    SELECT r.robot, r.id, b.event, min(b.stored_ns), sum(length(b.payload)), count(*)
    FROM sample_batches b JOIN robots r ON r.robot = b.robot WHERE b.first_ns >= 0
    GROUP BY r.robot, r.id, b.event ORDER BY min(b.stored_ns)
"""
_OLDEST = """
    SELECT batch, stream_id, epoch, first_seq, count, length(payload), stored_ns FROM sample_batches
    WHERE robot = ? AND event = ? AND first_ns >= 0 ORDER BY stored_ns, batch LIMIT ?
"""
_BATCHES = (
    "SELECT batch, channel, stream_id, epoch, first_seq, receive_ns, stored_ns, stamps, lengths, payload"
    " FROM sample_batches WHERE batch IN ({})"
)
_CHANNELS = f"SELECT {CHANNEL_COLUMNS} FROM channels c WHERE c.robot = ?"
_SAME = "SELECT batch, stream_id, epoch, first_seq, count FROM sample_batches WHERE batch IN ({}) ORDER BY batch"
_PUT_SEGMENT = """
    INSERT INTO segments (object, robot, event, first_ns, last_ns, stored_ns, size_bytes, messages)
    VALUES (?, ?, ?, ?, ?, ?, ?, ?)
"""
_LONGER = "UPDATE channels SET longest_ns = ? WHERE channel = ? AND longest_ns < ?"
_PUT_RUN = "INSERT INTO segment_runs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"


@dataclass(frozen=True, slots=True, kw_only=True)
class CompactPace:
    """When a robot's batches become a segment: when they are many bytes, or when the oldest is old."""

    size_bytes: int = 8 << 20  # of payloads; also what one segment is meant to hold
    age_s: float = 60.0
    small_bytes: int = 256 << 10  # fewer wait longer, or objects would be many and tiny
    small_age_s: float = 600.0
    batches: int = 8192  # of one segment: what the swap may change at once
    look_every_s: float = 2.0
    sweep_every_s: float = 60.0
    retry_s: float = 1.0  # after an error, doubled with each one that follows
    retry_most_s: float = 60.0
    lease_s: float = 30.0  # of the one gateway that compacts a shared store


@dataclass(frozen=True, slots=True)
class Due:
    """A robot's batches, events or all others, that are to be compacted."""

    robot: int
    robot_id: str
    event: int


class Compaction:
    """The steps, on a reading connection of the caller's thread; what changes the database goes through `run`."""

    def __init__(
        self,
        engine: StoreEngine,
        run: Transact,
        objects: ObjectStore,
        *,
        clock: Clock,
        pace: CompactPace | None = None,
        on_step: Callable[[str], None] = lambda step: None,
    ) -> None:
        self._engine = engine
        self._run = run
        self._objects = objects
        self._clock = clock
        self._pace = pace if pace is not None else CompactPace()
        self._on_step = on_step
        self._unpackable: set[int] = set()  # batches, by number: a mistake of ours that must not stop all others

    def due(self, *, everything: bool = False) -> list[Due]:
        """What is to be compacted now, the oldest first; with `everything` all that can be."""
        with self._engine.transaction(write=False):
            rows = self._engine.fetch(_DUE)
        now_ns = self._clock.wall_ns()
        return [Due(*row[:3]) for row in rows if everything or self._is_due(row, now_ns)]

    def compact(self, due: Due) -> int:
        """Move the oldest of these batches into one segment; how many went (0: there are none that can).

        Raises:
            PurgedError: somebody else compacted or purged some of them meanwhile; nothing happened.
            StoreError, ObjectStoreError: it did not happen; the batches are where they were.
        """
        picked, items = self._pick(due)
        self._on_step("picked")
        if not items:
            return 0
        segment, items = self._packed(items, due)
        if segment is None:
            return 0
        kept = {item[0] for item in items}
        self._store(due, [row for row in picked if row[0] in kept], segment)
        return len(items)

    def _is_due(self, row: Row, now_ns: int) -> bool:
        oldest_ns, size_bytes, count = row[3:6]
        pace = self._pace
        age_s = pace.age_s if size_bytes >= pace.small_bytes else pace.small_age_s
        full = size_bytes >= pace.size_bytes or count >= pace.batches
        return bool(full or now_ns - oldest_ns >= age_s * 1e9)

    def _pick(self, due: Due) -> tuple[list[Row], list[tuple[int, Packed]]]:
        """The oldest batches up to a segment's bounds, of one moment: their keys, and what they hold."""
        with self._engine.transaction(write=False):
            limit = self._pace.batches + len(self._unpackable)
            picked: list[Row] = []
            size_bytes = 0
            for row in self._engine.fetch(_OLDEST, due.robot, due.event, limit):
                if row[0] in self._unpackable:
                    continue
                # One commit's batches of a robot go together, so that retention, oldest first, leaves no holes.
                if size_bytes >= self._pace.size_bytes and row[6] != picked[-1][6]:
                    break
                picked.append(row)
                size_bytes += row[5]
            channels = {row[0]: stored_channel(due.robot_id, row) for row in self._engine.fetch(_CHANNELS, due.robot)}
            rows: dict[int, Row] = {}
            for some in slices([row[0] for row in picked]):
                for row in self._engine.fetch(_BATCHES.format(placeholders(len(some))), *some):
                    rows[row[0]] = row
        return picked, [(number, Packed(row[1], _batch(row, channels[row[1]]))) for number, row in rows.items()]

    def _packed(self, items: list[tuple[int, Packed]], due: Due) -> tuple[Segment | None, list[tuple[int, Packed]]]:
        """The segment and what is in it: without batches that cannot be packed, which stay where they are."""
        try:
            segment = pack([item for _, item in items], robot_id=due.robot_id)
        except Exception:
            log.exception("batches of robot %s cannot be packed", due.robot_id)
            sound = [(number, item) for number, item in items if self._can_be_packed(number, item, due)]
            if not sound or len(sound) == len(items):
                return None, []
            segment, items = pack([item for _, item in sound], robot_id=due.robot_id), sound
        self._on_step("packed")
        return segment, items

    def _can_be_packed(self, number: int, item: Packed, due: Due) -> bool:
        try:
            pack([item], robot_id=due.robot_id)
        except Exception as error:
            log.error("batch %d of robot %s stays as it came: %s", number, due.robot_id, error)
            self._unpackable.add(number)
            return False
        return True

    def _store(self, due: Due, picked: Sequence[Row], segment: Segment) -> None:
        """Steps 2 to 4; on an error the object is given up, unless it is stored after all."""
        name = f"segments/{due.robot}/{segment.stored_ns:020d}-{secrets.token_hex(8)}.mcap"
        self._run(lambda engine: announce(engine, name, kind="segment", now_ns=self._clock.wall_ns()))
        try:
            self._on_step("announced")
            self._objects.put(name, io.BytesIO(segment.data), size_bytes=len(segment.data), sha256=segment.sha256)
            self._on_step("put")
            self._run(lambda engine: self._swap(engine, due, picked, segment, name))
        except Exception:
            self._run(lambda engine: _give_up(engine, name, self._clock.wall_ns()))
            raise
        self._on_step("swapped")

    def _swap(self, engine: StoreEngine, due: Due, picked: Sequence[Row], segment: Segment, name: str) -> None:
        """The batches go and the segment comes; PurgedError when they are not exactly those that were read."""
        expected = {row[0]: tuple(row[1:5]) for row in picked}
        found: dict[int, tuple[Any, ...]] = {}
        for some in slices(sorted(expected)):
            for row in engine.fetch(_SAME.format(placeholders(len(some))) + engine.for_update, *some):
                found[row[0]] = tuple(row[1:5])
        if found != expected:
            raise PurgedError("the batches of a segment were purged or compacted by somebody else meanwhile")
        self._on_step("checked")
        gone = 0
        for some in slices(sorted(expected)):
            gone += engine.execute(f"DELETE FROM sample_batches WHERE batch IN ({placeholders(len(some))})", *some)
        if gone != len(expected) or segment.messages != sum(row[4] for row in picked):
            raise StoreError(f"{gone} batches were deleted, not {len(expected)}")
        self._on_step("deleted")
        _insert(engine, due, segment, name)
        self._on_step("inserted")
        stored(engine, name, size_bytes=len(segment.data), sha256=segment.sha256, now_ns=self._clock.wall_ns())
        self._on_step("stored")


def _insert(engine: StoreEngine, due: Due, segment: Segment, name: str) -> None:
    span = (segment.first_ns, segment.last_ns, segment.stored_ns)
    engine.execute(_PUT_SEGMENT, name, due.robot, due.event, *span, len(segment.data), segment.messages)
    number = engine.fetch("SELECT segment FROM segments WHERE object = ?", name)[0][0]
    engine.many(
        _PUT_RUN,
        [
            (
                number,
                run.channel,
                due.robot,
                run.stream_id,
                signed(run.epoch),
                run.first_seq,
                run.count,
                run.first_ns,
                run.last_ns,
                run.receive_ns,
                run.stored_ns,
                run.chunk_start,
                run.chunk_bytes,
                run.offset,
                run.size_bytes,
            )
            for run in segment.runs
        ],
    )
    longest: dict[int, int] = {}
    for run in segment.runs:
        longest[run.channel] = max(longest.get(run.channel, 0), run.last_ns - run.first_ns)
    for channel, lasts_ns in sorted(longest.items()):
        engine.execute(_LONGER, lasts_ns, channel, lasts_ns)


def _give_up(engine: StoreEngine, name: str, now_ns: int) -> None:
    """Doom an object that is not stored: a commit of which nobody knew may have happened."""
    state = engine.fetch(f"SELECT state FROM objects WHERE name = ?{engine.for_update}", name)
    if state and state[0][0] == "uploading":
        doom(engine, name, now_ns)


def _batch(row: Row, channel: Any) -> StoredBatch:
    stamps, lengths = np.frombuffer(row[7], np.int64), np.frombuffer(row[8], np.dtype("<u4"))
    return StoredBatch(channel, row[2], unsigned(row[3]), row[4], row[5], row[6], stamps, lengths, bytes(row[9]))
