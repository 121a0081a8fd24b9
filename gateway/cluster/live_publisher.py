"""Publishes samples of local robots to the gateways whose viewers subscribe to them, and to no others.

They go once a tick, all of a gateway's together. What a gateway takes no more waits, up to a bound; then the oldest
are dropped, and counted.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from gateway.cluster.ports import Mesh
from gateway.cluster.wire import MESSAGE_BYTES
from gateway.domain.sample import Run
from gateway.ingest.registry import Registry
from gateway.live.demand import merge_rates
from gateway.live.video import is_video
from metaros._proto import cluster_pb2, link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS
from metaros.link.video_frames import KEYS_ONLY_HZ, Frame, frame_of

__all__ = ["INTEREST", "KEYS", "LIVE", "LivePublisher"]

INTEREST: Final = "interest"
KEYS: Final = "keys"
LIVE: Final = "live"
TOGETHER_BYTES: Final = 256 * 1024  # in one message, or one run that is larger
LENGTH: Final = np.dtype("<u4")


@dataclass(slots=True)
class _Want:
    """How much of a topic a gateway wants. Thinned by the samples' stamps, as for a viewer here."""

    rate_hz: float
    last_ns: int | None = None

    def passes(self, stamp_ns: int) -> bool:
        """Whether a sample is one of those."""
        if self.last_ns is not None and self.last_ns <= stamp_ns < self.last_ns + 0.999e9 / self.rate_hz:
            return False
        self.last_ns = stamp_ns
        return True


@dataclass(slots=True)
class _Queue:
    """What waits for one gateway: runs as they go out, and how many samples each has."""

    waiting: deque[tuple[bytes, int]] = field(default_factory=deque)
    size_bytes: int = 0

    def put(self, run: bytes, count: int, *, most_bytes: int) -> int:
        """Returns how many samples were dropped for it. The newest run stays, however large it is."""
        dropped = 0
        self.waiting.append((run, count))
        self.size_bytes += len(run)
        while self.size_bytes > most_bytes and len(self.waiting) > 1:
            oldest, lost = self.waiting.popleft()
            self.size_bytes -= len(oldest)
            dropped += lost
        return dropped

    def take(self) -> tuple[bytes, int]:
        """One message, and how many samples are in it."""
        runs: list[bytes] = []
        size_bytes = samples = 0
        while self.waiting and (not runs or size_bytes + len(self.waiting[0][0]) <= TOGETHER_BYTES):
            run, count = self.waiting.popleft()
            runs.append(run)
            size_bytes += len(run)
            samples += count
        self.size_bytes -= size_bytes
        return (runs[0] if len(runs) == 1 else b"".join(runs)), samples

    def back(self, message: bytes, samples: int) -> None:
        """It was not taken: it is the first to go again."""
        self.waiting.appendleft((message, samples))
        self.size_bytes += len(message)


class LivePublisher:
    """All methods on the event loop."""

    def __init__(self, mesh: Mesh, registry: Registry, *, clock: Clock, tick_s: float) -> None:
        self.on_wanted: Callable[[str], None] = lambda robot: None  # other gateways want more of a robot, or less
        self.on_key_wanted: Callable[[str, str], None] = lambda robot, topic: None  # a viewer there needs a key frame
        self.sent_samples = self.sent_bytes = self.dropped = 0
        self._mesh = mesh
        self._registry = registry
        self._clock = clock
        self._tick_s = tick_s
        self._wants: dict[str, dict[str, dict[str, _Want]]] = {}  # by robot, gateway and topic
        self._lines: dict[str, _Queue] = {}
        self._flushed_s = float("-inf")
        self._timer: asyncio.TimerHandle | None = None
        mesh.on_message(INTEREST, self._on_interest)
        mesh.on_message(KEYS, self._on_key_wanted)
        mesh.on_peer(self._on_peer)

    @property
    def waiting_bytes(self) -> int:
        """Samples that wait for gateways."""
        return sum(line.size_bytes for line in self._lines.values())

    def wanted(self, robot: str) -> dict[str, float]:
        """What other gateways want of a robot: topic -> rate (0: every sample)."""
        rates: dict[str, list[float]] = {}
        for topics in self._wants.get(robot, {}).values():
            for topic, want in topics.items():
                rates.setdefault(topic, []).append(want.rate_hz)
        return {topic: merge_rates(some) for topic, some in rates.items()}

    def publish(self, run: Run) -> None:
        """Samples arrived here: they go out with the next tick."""
        wanted = self._wants.get(run.channel.robot)
        if wanted is None:
            return
        whole: bytes | None = None  # the same for every gateway that wants every sample
        for gateway, topics in wanted.items():
            want = topics.get(run.channel.topic)
            if want is None:
                continue
            if want.rate_hz <= 0 or (is_video(run.channel) and want.rate_hz > KEYS_ONLY_HZ):
                whole = whole or self._encoded(run)
                self._put(gateway, whole, run.count)
            else:
                for sample in _thinned(run, want):
                    self._put(gateway, self._encoded(sample), 1)

    def _put(self, gateway: str, run: bytes, count: int) -> None:
        line = self._lines.get(gateway)
        if line is not None and len(run) > MESSAGE_BYTES:
            self.dropped += count
        elif line is not None:
            self.dropped += line.put(run, count, most_bytes=LIMITS.cluster_live_bytes)
            if self._timer is None:
                delay_s = max(0.0, self._flushed_s + self._tick_s - self._clock.monotonic_s())
                self._timer = asyncio.get_running_loop().call_later(delay_s, self._flush)

    def _flush(self) -> None:
        self._timer, self._flushed_s = None, self._clock.monotonic_s()
        for gateway, line in list(self._lines.items()):
            while line.waiting:
                message, samples = line.take()
                if not self._mesh.send(gateway, LIVE, message):
                    line.back(message, samples)
                    break
                self.sent_samples += samples
                self.sent_bytes += len(message)
        if self._timer is None and any(line.waiting for line in self._lines.values()):
            self._timer = asyncio.get_running_loop().call_later(self._tick_s or 0.005, self._flush)

    def _encoded(self, run: Run) -> bytes:
        columns = run.columns
        batch = link_pb2.Batch(
            stream_id=run.channel.channel_id,
            epoch=columns.epoch,
            first_seq=columns.first_seq,
            count=columns.count,
            stamps=columns.stamps_ns.tobytes(),
            lengths=np.diff(columns.offsets).astype(LENGTH).tobytes(),
            payload=columns.payload,
        )
        generation = self._registry.get(run.channel.robot).generation
        message = cluster_pb2.ForwardedRun(
            robot=run.channel.robot, generation=generation, receive_ns=run.receive_ns, batch=batch
        )
        return cluster_pb2.Forwarded(runs=[message]).SerializeToString()

    def _on_interest(self, sender: str, payload: bytes) -> None:
        message = cluster_pb2.Interest.FromString(payload)
        if message.anew:
            self._forget(sender)
        for item in message.robots:
            topics = {
                wanted.topic: _Want(max(0.0, wanted.max_rate_hz)) for wanted in item.topics[: LIMITS.channels_per_robot]
            }
            self._want(sender, item.robot, topics)

    def _on_key_wanted(self, sender: str, payload: bytes) -> None:
        message = cluster_pb2.KeyFrameWanted.FromString(payload)
        self.on_key_wanted(message.robot, message.topic)

    def _want(self, gateway: str, robot: str, topics: dict[str, _Want]) -> None:
        if self._registry.find(robot) is None:
            return
        if topics:
            before = self._wants.setdefault(robot, {}).get(gateway, {})
            for topic, want in topics.items():
                if topic in before:
                    want.last_ns = before[topic].last_ns
            self._wants[robot][gateway] = topics
        elif robot in self._wants:
            self._wants[robot].pop(gateway, None)
            if not self._wants[robot]:
                del self._wants[robot]
        self.on_wanted(robot)

    def _on_peer(self, gateway: str, came: bool) -> None:
        self._forget(gateway)
        self._lines.pop(gateway, None)
        if came:
            self._lines[gateway] = _Queue()

    def _forget(self, gateway: str) -> None:
        """It wants nothing."""
        for robot in [robot for robot, wanted in self._wants.items() if gateway in wanted]:
            self._want(gateway, robot, {})


def _thinned(run: Run, want: _Want) -> Iterator[Run]:
    """Those of a run's samples that pass, of video key frames only; each alone: their numbers are no row any more."""
    for index, (seq, stamp_ns, payload) in enumerate(run.columns.samples()):
        if can_be_thinned(run, payload) and want.passes(stamp_ns):
            columns = replace(
                run.columns,
                first_seq=seq,
                stamps_ns=run.columns.stamps_ns[index : index + 1],
                offsets=np.array((0, len(payload)), np.int64),
                payload=bytes(payload),
            )
            yield replace(run, columns=columns, trace=None)


def can_be_thinned(run: Run, payload: bytes | memoryview) -> bool:
    """Whether a sample is of use without those before it."""
    channel = run.channel
    if not is_video(channel) or channel.encoding != "cdr":
        return True
    return frame_of(channel.schema_name, bytes(payload)) is not Frame.DELTA
