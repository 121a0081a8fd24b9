"""Loading what was found: a run's samples, out of a batch's row or out of one chunk of a segment.

A run is asked for by what it is, not by where it was: one that was compacted since it was found is looked for again.
Chunks that were read last are kept, for a viewer asks for what lies beside what it has just seen.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Sequence

import numpy as np

from gateway.errors import CorruptObjectError, DamagedError, ObjectMissingError, PurgedError
from gateway.store.engine import StoreEngine, signed
from gateway.store.objects import ObjectStore
from gateway.store.telemetry.samples import ObjectLocation, StoredBatch, StoredRun
from gateway.store.telemetry.segments import open_chunk, unpack
from metaros.limits import LIMITS

__all__ = ["RunLoader"]

_BATCH = (
    "SELECT b.receive_ns, b.stored_ns, b.stamps, b.lengths, b.payload FROM sample_batches b"
    " JOIN robots r ON r.robot = b.robot WHERE r.id = ? AND b.stream_id = ? AND b.epoch = ? AND b.first_seq = ?"
)
_RUN = (
    "SELECT b.first_seq, b.count, s.object, b.chunk_start, b.chunk_bytes, b.place FROM segment_runs b"
    " JOIN segments s ON s.segment = b.segment JOIN robots r ON r.robot = b.robot"
    " WHERE r.id = ? AND b.stream_id = ? AND b.epoch = ? AND b.first_seq <= ? ORDER BY b.first_seq DESC LIMIT 1"
)


class RunLoader:
    """Loads runs, from any thread; each caller brings its own connection."""

    def __init__(self, objects: ObjectStore | None = None, *, cache_bytes: int = LIMITS.segment_cache_bytes) -> None:
        self._objects = objects
        self._cache = _ChunkCache(cache_bytes)

    def load(self, engine: StoreEngine, run: StoredRun) -> StoredBatch:
        """The run's samples.

        Raises:
            PurgedError: it was found a moment ago, and is not stored any more.
            DamagedError: it is stored, and cannot be read.
            StoreError, ObjectStoreError: it may work later.
        """
        key = (run.channel.robot, run.stream_id, signed(run.epoch), run.first_seq)
        if run.place is None:
            with engine.transaction(write=False):
                batches = engine.fetch(_BATCH, *key)
                runs = engine.fetch(_RUN, *key) if not batches else []
            for row in batches:
                stamps, lengths = np.frombuffer(row[2], np.int64), np.frombuffer(row[3], np.dtype("<u4"))
                return self._batch(run, row[0], row[1], run.first_seq, stamps, lengths, bytes(row[4]))
            for first_seq, count, *place in runs:
                if first_seq + count >= run.first_seq + run.count:
                    whole = self._read(engine, run, ObjectLocation(*place), first_seq, count)
                    return whole.cut(run.first_seq, run.count)
            raise _purged(run)
        return self._read(engine, run, run.place, run.first_seq, run.count)

    def newest(
        self, engine: StoreEngine, candidates: Sequence[StoredRun], t_ns: int, *, max_age_ns: int | None = None
    ) -> StoredRun | None:
        """Which of `newest_candidates` has the newest sample at or before `t_ns`; None when that is too old."""
        best: StoredRun | None = None
        best_ns = -(1 << 63)
        for run in candidates:
            if run.last_ns <= t_ns:
                newest_ns = run.last_ns
            elif len(candidates) == 1 and max_age_ns is None:
                return run
            else:
                stamps = self.load(engine, run).stamps_ns
                newest_ns = int(stamps[stamps <= t_ns].max())
            if best is None or newest_ns > best_ns:
                best, best_ns = run, newest_ns
        return best if max_age_ns is None or best_ns >= t_ns - max_age_ns else None

    def _read(
        self, engine: StoreEngine, run: StoredRun, place: ObjectLocation, first_seq: int, count: int
    ) -> StoredBatch:
        """A run of a segment, as long as the segment is there."""
        try:
            records = self._records(place)
            stamps, lengths, payload = unpack(records, offset=place.offset, first_seq=first_seq, count=count)
        except ObjectMissingError:
            with engine.transaction(write=False):
                known = engine.fetch("SELECT 1 FROM segments WHERE object = ?", place.object_name)
            if not known:
                raise _purged(run) from None
            raise
        except CorruptObjectError as error:
            raise CorruptObjectError(f"{place.object_name}: {error}") from None
        return self._batch(run, run.receive_ns, run.stored_ns, first_seq, stamps, lengths, payload)

    def _records(self, place: ObjectLocation) -> bytes:
        """The records of the chunk that the run lies in."""
        key = (place.object_name, place.chunk_start)
        records = self._cache.get(key)
        if records is None:
            if self._objects is None:
                raise DamagedError(f"{place.object_name} is in an object store, and there is none")
            data = self._objects.read(place.object_name, start=place.chunk_start, size_bytes=place.chunk_bytes)
            records = open_chunk(data)
            self._cache.put(key, records)
        return records

    def _batch(
        self,
        run: StoredRun,
        receive_ns: int,
        stored_ns: int,
        first_seq: int,
        stamps: np.typing.NDArray[np.int64],
        lengths: np.typing.NDArray[np.uint32],
        payload: bytes,
    ) -> StoredBatch:
        options = (receive_ns, stored_ns, stamps, lengths, payload)
        return StoredBatch(run.channel, run.stream_id, run.epoch, first_seq, *options)


class _ChunkCache:
    """The chunks that were read last, up to a bound in bytes."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._size_bytes = 0
        self._chunks: OrderedDict[tuple[str, int], bytes] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: tuple[str, int]) -> bytes | None:
        with self._lock:
            records = self._chunks.get(key)
            if records is not None:
                self._chunks.move_to_end(key)
            return records

    def put(self, key: tuple[str, int], records: bytes) -> None:
        if len(records) > self._most_bytes:
            return
        with self._lock:
            if key in self._chunks:
                return
            self._chunks[key] = records
            self._size_bytes += len(records)
            while self._size_bytes > self._most_bytes:
                _, gone = self._chunks.popitem(last=False)
                self._size_bytes -= len(gone)


def _purged(run: StoredRun) -> PurgedError:
    return PurgedError(f"{run.channel.topic} of {run.channel.robot} from number {run.first_seq} on is purged")
