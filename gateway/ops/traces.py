"""Traced samples: those under way, and the newest that have ended. Everything here is on the event loop.

A trace ends with the tick after its sample's row was committed and viewers have it, as far as it has either.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from gateway.domain.channel import LIVE
from gateway.domain.sample import Run
from gateway.domain.trace import RobotTimes
from gateway.ops.sample_trace import TracedSample
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Traces"]

_ROW_S: Final = 30.0  # a trace waits so long for its row,
_VIEWERS_S: Final = 1.0  # and so long for viewers: nobody may be looking, or at a lower rate


@dataclass(slots=True)
class _Open:
    """A traced sample, since when it is under way, and whether it will have a row."""

    traced: TracedSample
    since_s: float
    durable: bool

    def over(self, now_s: float) -> bool:
        """Whether nothing more is to be waited for."""
        age_s, traced = now_s - self.since_s, self.traced
        stored = traced.committed_ns > 0 or not self.durable or age_s >= _ROW_S
        return stored and (traced.written_ns > 0 or age_s >= _VIEWERS_S)


class Traces:
    """`on_ended` gets every trace once. More than `traces_per_s` are not followed, only counted."""

    def __init__(
        self, clock: Clock, *, on_ended: Callable[[TracedSample], None] = lambda traced: None, limits: Limits = LIMITS
    ) -> None:
        self._clock = clock
        self._on_ended = on_ended
        self._limits = limits
        self._open: dict[str, _Open] = {}
        self._ended: deque[TracedSample] = deque(maxlen=limits.traces_kept)
        self._second = -math.inf
        self._taken = 0
        self.followed = 0
        self.skipped = 0

    def arrived(self, run: Run) -> None:
        """A run was given to viewers, if there are any, and goes to the store next, if it is to be stored."""
        self._begin(run, self._clock.wall_ns())

    def written(self, run: Run) -> None:
        """Viewers have it, or some of them: what was made of the run was given to their transports."""
        if run.trace is not None and (found := self._open.get(_key(run.channel.robot, run.trace))) is not None:
            found.traced = found.traced.written(self._clock.wall_ns())

    def committed(self, runs: Iterable[Run]) -> None:
        """These rows are stored."""
        for run in runs:
            found = self._begin(run, run.receive_ns)  # a copy for the history alone was given to nobody else
            if found is not None:
                found.traced = found.traced.committed(self._clock.wall_ns())

    def tick(self) -> None:
        """End the traces that are over; call about once a second."""
        now_s = self._clock.monotonic_s()
        for key, found in list(self._open.items()):
            if found.over(now_s):
                del self._open[key]
                self._ended.append(found.traced)
                self._on_ended(found.traced)

    def newest(
        self, *, robot: str = "", topic: str = "", sees: Callable[[str], bool], limit: int
    ) -> list[TracedSample]:
        """The last that ended, newest first, of robots that `sees` says yes to."""
        found: list[TracedSample] = []
        for traced in reversed(self._ended):
            wanted = robot in ("", traced.robot) and topic in ("", traced.topic)
            if wanted and sees(traced.robot):
                found.append(traced)
                if len(found) == limit:
                    break
        return found

    def _begin(self, run: Run, given_ns: int) -> _Open | None:
        """The trace of a run's sample: the one under way, or a new one if it is the first to be heard of it."""
        times = run.trace
        if times is None:
            return None
        key, index = _key(run.channel.robot, times), times.seq - run.columns.first_seq
        found = self._open.get(key)
        if found is not None or not 0 <= index < run.count or not self._may():  # it may have been known already
            return found
        self.followed += 1
        traced = TracedSample(
            robot=run.channel.robot,
            topic=run.channel.topic,
            delivery=run.channel.delivery,
            size_bytes=run.size_bytes,
            samples=run.count,
            times=times,
            stamp_ns=int(run.columns.stamps_ns[index]),
            received_ns=run.receive_ns,
            given_ns=given_ns,
        )
        found = self._open[key] = _Open(traced, self._clock.monotonic_s(), run.channel.delivery != LIVE)
        return found

    def _may(self) -> bool:
        """Whether another one may begin in this second."""
        second = math.floor(self._clock.monotonic_s())
        if second != self._second:
            self._second, self._taken = second, 0
        self._taken += 1
        if self._taken > self._limits.traces_per_s or len(self._open) >= self._limits.traces_kept:
            self.skipped += 1
            return False
        return True


def _key(robot: str, times: RobotTimes) -> str:
    return f"{robot} {times.trace_id} {times.span_id}"
