"""A scan of a robot's stored messages in order of time, in windows: each is a consistent view of the store.

The next window begins where the one before was complete, by time and not by row: whatever compaction does to the rows
between two windows, no message is passed over and none comes twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from gateway.errors import DamagedError, InvalidRequestError, PurgedError
from gateway.history.losses import Loss, merged_losses
from gateway.history.messages import HOLD_BYTES, Message, merged
from gateway.history.source import Source, loss_reason
from gateway.store.telemetry.samples import SampleFilter, StoredBatch, StoredRun

__all__ = ["MOST_RUNS", "Scan"]

MOST_RUNS = 1 << 16  # of one moment: so many overlap nowhere but in a store of stamps that stand still
NEAR_NS = 60 * 10**9  # unreadable runs no further apart are told as one loss


@dataclass(kw_only=True)
class Scan:
    """What is wanted of one robot; both ends are included. `losses` collects what could not be read on the way."""

    source: Source
    robot_id: str
    topics: tuple[str, ...]
    start_ns: int
    end_ns: int
    newest_first: bool = False
    window_runs: int = 256
    hold_bytes: int = HOLD_BYTES
    losses: list[Loss] = field(default_factory=list)
    stopped: Callable[[], bool] = lambda: False
    _lost: set[tuple[int, int, int]] = field(default_factory=set)

    def messages(self) -> Iterator[Message]:
        """Every message, until `stopped`."""
        wanted = SampleFilter(topics=self.topics, start_ns=self.start_ns, end_ns=self.end_ns)
        limit = self.window_runs
        while self.topics and not self.stopped():
            runs = self.source.runs(self.robot_id, wanted, newest_first=self.newest_first, limit=limit)
            border_ns = self._border(runs) if len(runs) >= limit else None
            yield from self._window(runs, wanted, border_ns)
            if border_ns is None:
                return
            begin_ns = wanted.end_ns if self.newest_first else wanted.start_ns
            if border_ns == begin_ns:  # all of them overlap its first moment
                limit *= 2
                if limit > MOST_RUNS:
                    raise InvalidRequestError(f"more than {MOST_RUNS} runs of messages have the stamp {border_ns} ns")
                continue
            wanted = replace(wanted, end_ns=border_ns) if self.newest_first else replace(wanted, start_ns=border_ns)
            limit = self.window_runs

    def _border(self, runs: Sequence[StoredRun]) -> int:
        """From this stamp on there may be runs that were not found."""
        return runs[-1].last_ns if self.newest_first else runs[-1].first_ns

    def _window(self, runs: Sequence[StoredRun], wanted: SampleFilter, border_ns: int | None) -> Iterator[Message]:
        """The messages before the border."""
        found = merged(
            runs,
            self._load,
            start_ns=self.start_ns if wanted.start_ns is None else wanted.start_ns,
            end_ns=self.end_ns if wanted.end_ns is None else wanted.end_ns,
            newest_first=self.newest_first,
            hold_bytes=self.hold_bytes,
        )
        for message in found:
            if border_ns is not None and (
                message.stamp_ns <= border_ns if self.newest_first else message.stamp_ns >= border_ns
            ):
                return
            yield message

    def _load(self, run: StoredRun) -> StoredBatch | None:
        """A run's samples; None, and a loss, when they cannot be read any more."""
        if self.stopped():
            return None
        try:
            return self.source.load(run)
        except (DamagedError, PurgedError) as error:
            key = (run.stream_id, run.epoch, run.first_seq)
            if key not in self._lost:
                self._lost.add(key)
                loss = Loss(
                    from_ns=run.first_ns,
                    to_ns=run.last_ns,
                    count=run.count,
                    reason=loss_reason(error),
                    topic=run.channel.topic,
                )
                self.losses = merged_losses([*self.losses, loss], within_ns=NEAR_NS)
            return None
