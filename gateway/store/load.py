"""Loading what was found: a run's samples, out of a batch's row or out of one chunk of a segment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gateway.errors import PurgedError
from gateway.store.engine import StoreEngine, signed
from gateway.store.samples import StoredBatch, StoredRun

__all__ = ["RunLoader"]

_BATCH = (
    "SELECT b.receive_ns, b.stored_ns, b.stamps, b.lengths, b.payload FROM sample_batches b"
    " JOIN robots r ON r.robot = b.robot WHERE r.id = ? AND b.stream_id = ? AND b.epoch = ? AND b.first_seq = ?"
)


class RunLoader:
    """Loads runs, from any thread; each caller brings its own connection."""

    def load(self, engine: StoreEngine, run: StoredRun) -> StoredBatch:
        """The run's samples.

        Raises:
            PurgedError: it was found a moment ago, and is not stored any more.
        """
        with engine.transaction(write=False):
            rows = engine.fetch(_BATCH, run.channel.robot, run.stream_id, signed(run.epoch), run.first_seq)
        for receive_ns, stored_ns, stamps, lengths, payload in rows:
            return StoredBatch(
                run.channel,
                run.stream_id,
                run.epoch,
                run.first_seq,
                receive_ns,
                stored_ns,
                np.frombuffer(stamps, np.int64),
                np.frombuffer(lengths, np.dtype("<u4")),
                bytes(payload),
            )
        raise PurgedError(f"{run.channel.topic} of {run.channel.robot} from number {run.first_seq} on is purged")

    def newest(
        self, engine: StoreEngine, candidates: Sequence[StoredRun], t_ns: int, *, max_age_ns: int | None = None
    ) -> StoredRun | None:
        """Which of `newest_candidates` has the newest sample at or before `t_ns`; None when that is too old."""
        best: StoredRun | None = None
        best_ns = -(1 << 63)
        for run in candidates:
            if run.last_ns <= t_ns:
                newest_ns = run.last_ns
            elif run.first_ns < best_ns and run.count == 1:
                continue
            else:
                stamps = self.load(engine, run).stamps_ns
                newest_ns = int(stamps[stamps <= t_ns].max())
            if best is None or newest_ns > best_ns:
                best, best_ns = run, newest_ns
        return best if max_age_ns is None or best_ns >= t_ns - max_age_ns else None
