"""The outbox against a model: random appends, sends, acks, crashes, failures and full disks; nothing lost unsaid."""

from __future__ import annotations

import random  # noqa: TID251 - seeded, one a case
from dataclasses import dataclass, field

import pytest

from edge_agent.errors import DiskError
from edge_agent.outbox import LOGS, ClassPolicy, Kind, Outbox, run_steps, steps
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.limits import Limits
from tests.support.simulation.sim_disk import Crash, SimDisk

KIB = 1024
CLASSES = {
    "event": ClassPolicy(quota_bytes=512 * KIB, when_full="refuse", sync_s=0.0, sync_bytes=1),
    "metric": ClassPolicy(quota_bytes=600 * KIB, when_full="thin", sync_s=0.0, sync_bytes=1),
    "bulk": ClassPolicy(quota_bytes=600 * KIB, when_full="drop", sync_s=0.0, sync_bytes=1),
}
STREAMS = {1: "event", 2: "bulk", 3: "bulk", 0: "metric"}
LIMITS = Limits(batch_bytes=8 * KIB, batch_samples=16)


@dataclass
class Keeper:
    """A gateway's rules in a few lines: rows and gaps in order, duplicates dropped, holes refused."""

    rows: dict[tuple[int, int], dict[int, object]] = field(default_factory=dict)
    gaps: dict[tuple[int, int], set[int]] = field(default_factory=dict)
    marks: dict[tuple[int, int], int] = field(default_factory=dict)

    def take(self, epoch: int, frame: object) -> None:
        key = (epoch, frame.stream_id)  # type: ignore[attr-defined]
        mark = self.marks.get(key, 0)
        first, last = frame.first_seq, frame.last_seq  # type: ignore[attr-defined]
        assert first <= mark + 1, f"{key}: {first} follows {mark}"
        if frame.kind is Kind.GAP:  # type: ignore[attr-defined]
            self.gaps.setdefault(key, set()).update(range(mark + 1, last + 1))
        else:
            rows = self.rows.setdefault(key, {})
            for seq, content in zip(range(first, last + 1), contents(frame), strict=True):
                if seq > mark:
                    rows[seq] = content
        self.marks[key] = max(mark, last)


def contents(frame: object) -> list[object]:
    if frame.kind is Kind.SAMPLES:  # type: ignore[attr-defined]
        return list(map(int, memoryview(link_pb2.Batch.FromString(frame.body).stamps).cast("q")))  # type: ignore[attr-defined]
    return list(map(int, memoryview(link_pb2.MetricBatch.FromString(frame.body).stamps).cast("q")))  # type: ignore[attr-defined]


class World:
    """One robot's disk, the outbox that now runs on it, and the gateway."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.clock = ManualClock()
        self.disk = SimDisk(self.rng, size_bytes=self.rng.choice([1 << 40, 900 * KIB, 300 * KIB]))
        self.session_manager = Keeper()
        self.stamp = 0
        self.accepted: dict[tuple[int, int], int] = {}
        self.outbox = self.start()

    def start(self) -> Outbox:
        while True:
            try:
                outbox = Outbox(
                    self.disk,
                    self.clock,
                    new_epoch=lambda: self.rng.getrandbits(64),
                    writer=f"{self.rng.getrandbits(64):016x}",
                    classes=CLASSES,
                    reserve_bytes=64 * KIB,
                    limits=LIMITS,
                )
            except Crash:
                self.disk.crash_in = None
                continue
            except DiskError:  # the agent waits for a disk that works
                self.disk.foreign_bytes, self.disk.size_bytes = 0, 1 << 40
                continue
            outbox.resume(self.keeper_marks())
            return outbox

    def keeper_marks(self) -> dict[tuple[int, int], int]:
        return dict(self.session_manager.marks)

    def step(self) -> None:
        act = self.rng.choice(
            ["append"] * 4 + ["flush"] * 4 + ["send"] * 3 + ["ack", "link", "crash", "fail", "fill", "resume"]
        )
        getattr(self, act)()

    def append(self) -> None:
        for _ in range(self.rng.randrange(1, 40)):
            stream = self.rng.choice(list(STREAMS))
            delivery = STREAMS[stream]
            self.stamp += 1
            if self.rng.random() < 0.02:
                self.outbox.give_up(stream, delivery, "too_large")
            elif delivery == "metric":
                self.outbox.append(stream, delivery, self.stamp, (1, 0.5))
            else:
                self.outbox.append(stream, delivery, self.stamp, bytes(self.rng.choice([10, 300, 5000, 20000])))

    def flush(self) -> None:
        for name in LOGS:
            self.clock.advance(0.01)
            run_steps(steps(self.outbox, self.disk, name))
        for held in self.outbox.ranges():
            self.accepted[held.epoch, held.stream_id] = held.last_seq

    def send(self) -> None:
        name = self.rng.choice(LOGS)
        for _ in range(self.rng.randrange(1, 30)):
            taken = self.outbox.take(name)
            if taken is None:
                break
            if self.rng.random() < 0.9:
                self.session_manager.take(self.outbox.epoch_of(taken.era), taken.frame)
            else:  # the link is cut with this frame in it
                self.resume()
                break

    def ack(self) -> None:
        for (epoch, stream), seq in self.session_manager.marks.items():
            self.outbox.acknowledge(stream, epoch, seq)

    def link(self) -> None:
        self.outbox.online = not self.outbox.online

    def crash(self) -> None:
        self.disk.crash_in = self.rng.randrange(6)
        try:
            self.append()
            self.flush()
            self.send()
            self.flush()
        except Crash:
            pass
        self.disk.crash_in = None
        self.outbox = self.start()

    def fail(self) -> None:
        self.disk.fail_in = self.rng.randrange(3)

    def fill(self) -> None:
        self.disk.foreign_bytes = self.rng.choice([0, 0, max(0, self.disk.free()[0] - self.rng.randrange(2000))])

    def resume(self) -> None:
        self.outbox.resume(self.keeper_marks())

    def drain(self) -> None:
        self.disk.foreign_bytes, self.disk.fail_in, self.disk.size_bytes = 0, None, 1 << 40
        for _ in range(3):
            self.flush()
            self.outbox.resume(self.keeper_marks())
            for name in LOGS:
                while (taken := self.outbox.take(name)) is not None:
                    self.session_manager.take(self.outbox.epoch_of(taken.era), taken.frame)
            self.clock.advance(1)
            self.ack()


def check(world: World) -> None:
    """Rows and gaps are 1 .. last accepted, disjoint; no content twice."""
    seen: set[tuple[int, object]] = set()
    for key, last in world.accepted.items():
        rows, gaps = set(world.session_manager.rows.get(key, {})), world.session_manager.gaps.get(key, set())
        assert not rows & gaps
        assert rows | gaps >= set(range(1, last + 1)), (key, last)
    for (_, stream), rows in world.session_manager.rows.items():
        for content in rows.values():
            assert (stream, content) not in seen
            seen.add((stream, content))


@pytest.mark.parametrize("block", range(2))
def test_nothing_is_lost_without_a_gap(block: int) -> None:
    for seed in range(block * 20, block * 20 + 20):
        world = World(seed)
        try:
            for _ in range(60):
                world.step()
            world.drain()
            check(world)
            assert all(world.outbox.depth(name).samples == 0 for name in CLASSES)
        except BaseException:
            print(f"seed {seed}")
            raise
