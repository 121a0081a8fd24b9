"""The black box at work: a queue bounded in bytes between the tap's thread and one thread that writes the ring.

The tap's thread pays one append a batch. The writer copies, packs and compresses what has gathered, a few times a
second: waking it for each sample would cost more than all the rest. What finds the queue full is lost to the black box
alone, and noted with its publisher, so that every clip declares it.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from edge_agent.blackbox.publisher import RecordedPublisher
from edge_agent.blackbox.ring import Ring, RingFile
from edge_agent.config.black_box import BlackBoxSettings
from edge_agent.errors import BlackBoxOffError
from edge_agent.forwarding.pipeline import Arrival
from edge_agent.forwarding.scope import ROSOUT
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.idl.globs import Glob
from metaros.limits import LIMITS
from metaros.record.ledger import Publisher

__all__ = ["BlackBox", "RingSnapshot"]

T = TypeVar("T")
LOG = logging.getLogger("metaros.agent.black_box")
GATHER_S: Final = 0.2  # how long samples gather before the writer looks,
GATHER_BYTES: Final = 4 << 20  # or how much of them
TICK_S: Final = 1.0
AFTER_S: Final = 10.0  # what follows a log line of level FATAL so long goes to disk with what led to it
_LEVEL, _FATAL = 12, b"\x32"  # where the CDR of rcl_interfaces/msg/Log has its level
OVERHEAD_BYTES: Final = 512  # what a waiting sample weighs beside its payload
_MOST_SOURCES: Final = 65_000  # publishers; an MCAP file knows no more channels


class RingSnapshot(NamedTuple):
    """The ring's files, held for a reader; the publishers know what is missing in them."""

    files: Sequence[RingFile]
    latched: Path  # the path of the file with latched samples that left the ring
    publishers: dict[tuple[str, bytes], Publisher]  # by topic and GID


class _Batch(NamedTuple):
    arrivals: Sequence[Arrival]
    clock_ns: int  # what the wall's clock was ahead of the monotonic one
    size_bytes: int


class _Call(NamedTuple):
    call: Callable[[Ring], Any]
    future: Future[Any]

    def run(self, ring: Ring) -> None:
        try:
            self.future.set_result(self.call(ring))
        except Exception as error:
            self.future.set_exception(error)


@dataclass(frozen=True, slots=True)
class _Facts:
    """What the writer last said of the ring."""

    first_ns: int = 0
    last_ns: int = 0
    size_bytes: int = 0
    quota_bytes: int = 0
    lost: int = 0
    trouble: str = ""


class BlackBox:
    """Owns the writer's thread from `start` to `close`. `open_ring` is called on it, and reads what is there."""

    def __init__(
        self,
        settings: BlackBoxSettings,
        open_ring: Callable[[], Ring],
        clock: Clock,
        *,
        queue_bytes: int = LIMITS.black_box_queue_bytes,
    ) -> None:
        self._settings = settings
        self._open_ring = open_ring
        self._clock = clock
        self._queue_bytes = queue_bytes
        self._wanted = [Glob(pattern) for pattern in settings.topics]
        self._unwanted = [Glob(pattern) for pattern in settings.exclude]
        self._takes: dict[str, bool] = {}
        self._waiting: list[_Batch | _Call] = []
        self._wake = threading.Event()
        self._ending = False
        self._lock = threading.Lock()
        self._waiting_bytes = self._overflow = 0
        self._sources: dict[tuple[int, bytes], RecordedPublisher] = {}
        self._facts = _Facts()
        self._kept_s, self._keep_at_s = -math.inf, math.inf  # when it last went to disk, and when it is to
        self._failed = ""
        self._thread = threading.Thread(target=self._run, name="black-box", daemon=True)

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def close(self) -> None:
        """Write what came, end the open file, stop the thread."""
        with self._lock:
            self._ending = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join()

    def take(self, arrivals: Sequence[Arrival]) -> None:
        """On the tap's thread: samples as they came, before any selection."""
        size_bytes = sum(arrival.size_bytes for arrival in arrivals) + OVERHEAD_BYTES * len(arrivals)
        with self._lock:
            full = self._waiting_bytes + size_bytes > self._queue_bytes
            if not full:
                self._waiting_bytes += size_bytes
                clock_ns = self._clock.wall_ns() - round(self._clock.monotonic_s() * 1e9)
                self._waiting.append(_Batch(arrivals, clock_ns, size_bytes))
        if not full:
            if self._waiting_bytes > GATHER_BYTES:
                self._wake.set()
            return
        for arrival in arrivals:
            if self._wants(arrival.channel.topic):
                self._overflow += 1
                self._source(arrival).publisher.refuse(arrival.sequence, "dropped")

    def hold(self) -> Future[RingSnapshot]:
        """The files with everything that came until now, to be given back by `release`; or BlackBoxOffError."""
        return self._on_writer(lambda ring: RingSnapshot(ring.hold(), ring.latched_path, self._publishers()))

    def release(self) -> None:
        """The held files were read."""
        self._on_writer(Ring.release)

    @property
    def trouble(self) -> str:
        """Why nothing is written now; empty when all is well."""
        return self._failed or self._facts.trouble

    def describe(self) -> link_pb2.BlackBox:
        """How it does, for the gateway and for whoever asks the agent."""
        facts = self._facts
        return link_pb2.BlackBox(
            from_ns=facts.first_ns,
            to_ns=facts.last_ns,
            size_bytes=facts.size_bytes,
            quota_bytes=facts.quota_bytes or self._settings.quota_bytes,
            lost=facts.lost + self._overflow,
        )

    def _on_writer(self, call: Callable[[Ring], T]) -> Future[T]:
        """Have the writer's thread do it after everything that came until now."""
        future: Future[T] = Future()
        with self._lock:
            ending = self._ending
            if not ending:
                self._waiting.append(_Call(call, future))
        if ending:
            future.set_exception(BlackBoxOffError("the black box is closed"))
        self._wake.set()
        return future

    # -- the writer's thread -------------------------------------------------------------------------------------------

    def _run(self) -> None:
        ring: Ring | None = None
        try:
            ring = self._open_ring()
        except Exception as error:  # a robot without a black box still works
            LOG.exception("the black box is off")
            self._failed = f"the black box cannot be opened: {error}"
        next_s = self._clock.monotonic_s() + TICK_S
        while not self._ending:
            self._wake.wait(GATHER_S)
            self._wake.clear()
            self._all_that_waits(ring)
            if ring is not None and self._clock.monotonic_s() >= next_s:
                next_s = self._clock.monotonic_s() + TICK_S
                self._tick(ring)
                if self._clock.monotonic_s() >= self._keep_at_s:
                    self._keep_at_s, self._kept_s = math.inf, self._clock.monotonic_s()
                    ring.keep()
        self._all_that_waits(ring)
        if ring is not None:
            ring.end()

    def _all_that_waits(self, ring: Ring | None) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, []
        for item in waiting:
            if isinstance(item, _Call):
                if ring is None:
                    item.future.set_exception(BlackBoxOffError(self._failed))
                else:
                    item.run(ring)
                continue
            try:
                if ring is not None:
                    self._write(ring, item)
            except Exception:  # what nobody thought of must not end it
                LOG.exception("the black box lost something")
            with self._lock:
                self._waiting_bytes -= item.size_bytes

    def _tick(self, ring: Ring) -> None:
        try:
            ring.tick()
            first_ns, last_ns = ring.span_ns
            self._facts = _Facts(first_ns, last_ns, ring.size_bytes, ring.limit_bytes, ring.lost, ring.trouble)
        except Exception:
            LOG.exception("the black box does not keep its bounds")

    def _write(self, ring: Ring, batch: _Batch) -> None:
        takes, sources = self._takes, self._sources
        for channel, payload, _, stamp_ns, arrived_s, gid, sequence in batch.arrivals:
            wanted = takes.get(channel.topic)
            if wanted is None:
                wanted = self._wants(channel.topic)
            if wanted:
                source = sources.get((channel.channel_id, gid)) or self._meet(channel, gid)
                payload = bytes(payload)
                if channel.topic == ROSOUT and payload[_LEVEL : _LEVEL + 1] == _FATAL:
                    self._happened()
                log_ns = batch.clock_ns + round(arrived_s * 1e9)
                ring.write(source, sequence, log_ns, stamp_ns, payload)

    def _happened(self) -> None:
        """A program on the robot said that it is at its end: put on disk what led there, and a little after it.

        Not more often than what is kept in memory is another one by then.
        """
        if self._keep_at_s == math.inf:
            again_s = self._kept_s + 60 * self._settings.minutes
            self._keep_at_s = max(self._clock.monotonic_s() + AFTER_S, again_s)

    # -- both threads --------------------------------------------------------------------------------------------------

    def _wants(self, topic: str) -> bool:
        """Whether the settings name this topic."""
        wanted = self._takes.get(topic)
        if wanted is None:
            wanted = any(glob.matches(topic) for glob in self._wanted)
            wanted = wanted and not any(glob.matches(topic) for glob in self._unwanted)
            self._takes[topic] = wanted
        return wanted

    def _source(self, arrival: Arrival) -> RecordedPublisher:
        source = self._sources.get((arrival.channel.channel_id, arrival.gid))
        return source or self._meet(arrival.channel, arrival.gid)

    def _meet(self, channel: Any, gid: bytes) -> RecordedPublisher:
        """A publisher's first sample; the oldest known yields where there are too many."""
        while len(self._sources) >= _MOST_SOURCES:
            self._sources.pop(next(iter(self._sources)), None)
        publisher = Publisher(channel.topic, channel.type_name, gid)
        return self._sources.setdefault((channel.channel_id, gid), RecordedPublisher(channel, publisher))

    def _publishers(self) -> dict[tuple[str, bytes], Publisher]:
        return {
            (source.channel.topic, source.publisher.gid): source.publisher for source in list(self._sources.values())
        }
