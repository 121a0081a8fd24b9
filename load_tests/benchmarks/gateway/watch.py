"""What watching costs: 10,000 series at 1 Hz from the log to alerts; and what the event loop notices of it.

    python -m load_tests watch [--seconds 120] [--robots 400] [--series 25]

The rows are those of robots that drive: every series has a level, a wave and noise of its own. Nothing is between
`Watch.ahead`, which the store's writer calls, and the alerts in the database. Held: how much of a core the event loop's
thread worked between two turns of a task that wakes every millisecond; in brackets the same by the clock on the wall,
which on a busy machine says more of the machine.
"""

from __future__ import annotations

import argparse
import asyncio
import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gateway.alerting.alerts.manager import AlertManager
from gateway.alerting.watch.watch import Watch
from gateway.domain.channel import Series
from gateway.domain.finding import Edge, Finding
from gateway.domain.sample import Rows
from gateway.store import Store
from gateway.store.retention import Retention
from gateway.store.writes import Committed, Mark, StreamWrite
from load_tests.figures import note
from metaros.clock import ManualClock, SystemClock

__all__ = ["main"]

EPOCH = 7
GOAL_CORE = 0.10
GOAL_HELD_MS = 10.0
Row = tuple[str, str, bool]  # what, how much, whether it is as it shall be
FINDINGS = 10_000
NEW_SERIES = 4096


class Held:
    """The longest work for which nobody else had a turn on the event loop."""

    def __init__(self) -> None:
        self.work_s = self.wall_s = 0.0
        self._task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        while True:
            began_s, worked_s = time.perf_counter(), time.thread_time()
            await asyncio.sleep(0.001)
            self.work_s = max(self.work_s, time.thread_time() - worked_s)
            self.wall_s = max(self.wall_s, time.perf_counter() - began_s - 0.001)

    async def row(self, what: str) -> Row:
        """Since the last call."""
        await asyncio.sleep(0.005)
        work_ms, wall_ms = 1e3 * self.work_s, 1e3 * self.wall_s
        self.work_s = self.wall_s = 0.0
        return what, f"{work_ms:.1f} ms held ({wall_ms:.0f})", work_ms <= GOAL_HELD_MS

    def stop(self) -> None:
        """Measure no more."""
        self._task.cancel()


class Fleet:
    """Robots whose rows are made a second at a time."""

    def __init__(self, robots: int, series: int, *, start_ns: int, name: str = "robot") -> None:
        self.names = [f"{name}_{number}" for number in range(robots)]
        self._series = tuple(Series(f"topic_{n % 8}.value_{n}", f"/topic_{n % 8}", f"value_{n}") for n in range(series))
        self._rng = np.random.default_rng(1)
        self._level = self._rng.normal(0.0, 10.0, (robots, series))
        self._start_ns = start_ns
        self.second = 0

    def writes(self) -> list[StreamWrite]:
        """One second of all robots: a write each."""
        self.second += 1
        count = len(self._series)
        index = np.arange(count, dtype=np.uint32)
        wave = np.sin(self.second / 60.0 + self._level)
        values = self._level + wave + self._rng.normal(0.0, 0.1, self._level.shape)
        stamps = np.full(count, self._start_ns + self.second * 10**9, np.int64)
        return [
            StreamWrite(
                robot=name,
                stream_id=0,
                epoch=EPOCH,
                seq=self.second * count,
                rows=Rows(self._series, index, stamps, values[number]),
            )
            for number, name in enumerate(self.names)
        ]


async def committed(watch: Watch, writes: Sequence[StreamWrite]) -> None:
    """What the store's writer and its listener do with them."""
    await asyncio.to_thread(watch.ahead, writes)
    watch.on_committed(Committed(writes, [Mark(w.robot, w.stream_id, w.epoch, w.seq) for w in writes]))


async def measure(folder: Path, options: argparse.Namespace) -> list[Row]:
    """Everything, in the order of the table."""
    clock = ManualClock(wall_ns=SystemClock().wall_ns())
    store = Store(
        folder, clock=SystemClock(), retention=Retention(age_s=86_400.0, size_bytes=1 << 40), queue_bytes=64 << 20
    )
    store.start()
    alert_manager = AlertManager(store, clock=clock)
    await alert_manager.start()
    running = asyncio.create_task(alert_manager.run())
    watch = made(folder, store, clock, alert_manager)
    await watch.start()
    await watch.begin()
    fleet = Fleet(options.robots, options.series, start_ns=clock.wall_ns())
    held = Held()
    await held.row("")
    await asyncio.sleep(1.0)
    idle = await held.row("event loop, nothing else running")
    rows = await steady(watch, fleet, clock, held, options.seconds)
    rows += await bursts(watch, alert_manager, clock, held)
    held.stop()
    rows += await again(watch, folder, store, clock, alert_manager)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    await alert_manager.close()
    await store.close()
    return [idle, *rows]


def made(folder: Path, store: Store, clock: ManualClock, alert_manager: AlertManager) -> Watch:
    """The watch, as the gateway wires it."""

    async def no_clip(alert: object) -> object:
        raise AssertionError("nobody asks for a clip here")

    return Watch(folder / "watch", store, clock=clock, report=alert_manager.report, clip=no_clip)  # type: ignore[arg-type]


async def steady(watch: Watch, fleet: Fleet, clock: ManualClock, held: Held, seconds: int) -> list[Row]:
    """So many seconds of driving, one after another: what a second costs of a core."""
    costs = []
    for second in range(seconds):
        writes = await asyncio.to_thread(fleet.writes)
        clock.advance(1.0)
        if second == seconds // 3:
            await held.row("")  # all series are known, what grows has grown
        began_s = time.process_time()
        await committed(watch, writes)
        for robot in fleet.names:
            watch.facts.heartbeat(robot)
        await watch.run_cycle()
        costs.append(time.process_time() - began_s)
    core = float(np.median(costs[seconds // 3 :]))
    note("10,000 series at 1 Hz", [100 * cost for cost in costs[seconds // 3 :]])
    count = len(fleet.names) * len(writes[0].rows)  # type: ignore[arg-type]
    state = watch.describe()
    return [
        (f"{count:,} series at 1 Hz", f"{100 * core:.1f} % of a core", core <= GOAL_CORE),
        ("a row, from the log to alerts", f"{1e6 * core / count:.2f} µs", True),
        ("the worst second", f"{1e3 * max(costs):.0f} ms", True),
        await held.row("event loop meanwhile"),
        ("log", f"{state['log_bytes'] / seconds / count:.1f} bytes a row", True),
    ]


async def bursts(watch: Watch, alert_manager: AlertManager, clock: ManualClock, held: Held) -> list[Row]:
    """A robot that brings very many series, and very many findings at once."""
    await held.row("")
    newcomer = Fleet(1, NEW_SERIES, start_ns=clock.wall_ns(), name="newcomer")
    for _ in range(3):
        clock.advance(1.0)
        await committed(watch, await asyncio.to_thread(newcomer.writes))
        await watch.run_cycle()
    new = await held.row(f"{NEW_SERIES:,} new series of one robot")
    edges = await asyncio.to_thread(edges_of, clock.wall_ns() / 1e9)
    await held.row("")
    await watch.report_all(edges)
    await asyncio.sleep(3.0)  # they are stored, and listeners told
    return [new, await held.row(f"{FINDINGS:,} findings at once")]


def edges_of(now_s: float) -> list[Edge]:
    """Ten findings of each of a thousand robots."""
    return [
        Edge("opened", Finding(
            robot=f"burst_{number % 1000}", series=f"s{number // 1000}", kind="level", cause="change",
            severity="warning", score=0.7, value=1.0, low=0.0, high=0.5, reason="A test.", since_s=now_s,
        ), now_s)
        for number in range(FINDINGS)
    ]  # fmt: skip


async def again(watch: Watch, folder: Path, store: Store, clock: ManualClock, alert_manager: AlertManager) -> list[Row]:
    """A snapshot, and what a start from it and its log costs."""
    before = watch.describe()
    await watch.close()
    second = made(folder, store, clock, alert_manager)
    began_s, worked_s = time.perf_counter(), time.process_time()
    await second.start()
    started_s = time.perf_counter() - began_s
    await second.begin()
    replayed_s = time.process_time() - worked_s
    began_s = time.perf_counter()
    size_bytes = await second.snapshot()
    saved_s = time.perf_counter() - began_s
    await second.close()
    return [
        ("start, before it is ready", f"{1e3 * started_s:.0f} ms", started_s < 0.5),
        ("replay", f"{replayed_s:.1f} s of a core, {before['log_bytes'] / 1e6:.0f} MB", True),
        ("snapshot", f"{size_bytes / 1e6:.0f} MB in {saved_s:.1f} s", True),
    ]


def main(argv: list[str]) -> int:
    """A table; exit code 1 where a goal is missed."""
    parser = argparse.ArgumentParser(prog="python -m load_tests watch", description=__doc__)
    parser.add_argument("--seconds", type=int, default=120)
    parser.add_argument("--robots", type=int, default=400)
    parser.add_argument("--series", type=int, default=25)
    options = parser.parse_args(argv)
    folder = Path(tempfile.mkdtemp(prefix="bench-watch-"))
    try:
        rows = asyncio.run(measure(folder, options))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    for what, much, good in rows:
        print(f"  {what:36} {much:>24}{'' if good else '   MISSED'}")
    return int(not all(good for *_, good in rows))
