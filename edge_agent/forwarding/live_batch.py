"""When live samples have waited long enough, and how a batch of them is put together: columnar."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from edge_agent.forwarding.live_queue import LiveSample
from metaros._proto import link_pb2
from metaros.limits import LIMITS, Limits
from metaros.link import pack_batch, split_sample

__all__ = ["FLUSH_BYTES", "Linger", "sample_batches"]

FLUSH_BYTES = 64 * 1024


class Linger:
    """Says when what has gathered goes out: at `flush_bytes`, or `linger_s` after its first sample. Pure."""

    def __init__(self, *, linger_s: float = LIMITS.linger_s, flush_bytes: int = FLUSH_BYTES) -> None:
        self._linger_s = linger_s
        self._flush_bytes = flush_bytes
        self._since_s: float | None = None
        self._bytes = 0

    def add(self, size_bytes: int, now_s: float) -> None:
        """Another sample waits."""
        if self._since_s is None:
            self._since_s = now_s
        self._bytes += size_bytes

    def flushed(self) -> None:
        """Everything went out."""
        self._since_s = None
        self._bytes = 0

    def wait_s(self, now_s: float) -> float | None:
        """Seconds until the flush is due (0 = now), None while nothing waits."""
        if self._since_s is None:
            return None
        if self._bytes >= self._flush_bytes:
            return 0.0
        return max(0.0, self._since_s + self._linger_s - now_s)


def sample_batches(
    stream_id: int, epoch: int, samples: Sequence[LiveSample], *, limits: Limits = LIMITS
) -> Iterator[link_pb2.Batch]:
    """The Batches of a run of samples: one, or the pieces of a single large sample.

    Holes in the numbers start a new Batch.
    """
    start = 0
    for end in chain((i for i in range(1, len(samples)) if samples[i].seq != samples[i - 1].seq + 1), (len(samples),)):
        run = samples[start:end]
        payloads = [sample.data for sample in run]
        if len(run) == 1 and len(payloads[0]) > limits.batch_bytes:
            yield from split_sample(stream_id, epoch, run[0].seq, run[0].stamp_ns, payloads[0], limits=limits)
        elif run:
            yield pack_batch(stream_id, epoch, run[0].seq, [sample.stamp_ns for sample in run], payloads)
        start = end
