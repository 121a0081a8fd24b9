"""One run of a scenario: a gateway, simulated robots, a look at both every second, and what is written down of it."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import tempfile
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, Final

import psutil

from load_tests.fleet.figures import Histogram, Look, Probe, pss_bytes, tree_bytes
from load_tests.fleet.gateway import GatewayProcess
from load_tests.fleet.simulator import Simulator

__all__ = ["Run", "Setting", "running"]

LOOK_S: Final = 1.0
LATE_S: Final = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What all scenarios share: how robots connect, where the gateway keeps its data, which core it has."""

    transport: str = "grpc"
    store_url: str = ""
    core: int | None = None
    seed: int = 12
    gateway_options: Sequence[str] = ()
    quiet: bool = False
    warm: bool = False  # for tests: see GatewayProcess


@dataclass
class Run:
    """Figures of one run. `series` has a list for each name, all as long as `series["t"]`."""

    gateway: GatewayProcess
    simulator: Simulator
    setting: Setting
    series: dict[str, list[float]] = field(default_factory=dict)
    marks: list[tuple[float, str]] = field(default_factory=list)
    probe: Probe | None = None
    answers_s: Histogram = field(default_factory=Histogram)
    late_s: Histogram = field(default_factory=Histogram)  # of the simulator's own loop
    faults: list[str] = field(default_factory=list)
    gateway_cpu_s: float = 0.0  # of all its lives
    _began_s: float = 0.0
    _born: Look | None = None
    tasks: list[asyncio.Task[None]] = field(default_factory=list)

    @property
    def now_s(self) -> float:
        """Since the run began."""
        return self.simulator.clock.monotonic_s() - self._began_s

    def mark(self, text: str) -> None:
        """Something happened that plots show."""
        self.marks.append((round(self.now_s, 2), text))

    def start_gateway(self) -> None:
        """Start it, again perhaps; blocks, so call it in a thread while robots run."""
        self.probe = self.gateway.start()
        self._born = self.probe.look()  # what the start took is not the load's

    def look(self) -> Look | None:
        """The gateway now."""
        return self.probe.look() if self.probe is not None else None

    def between(self, name: str, from_s: float, to_s: float) -> list[float]:
        """A series' values of a span."""
        pairs = zip(self.series.get("t", ()), self.series.get(name, ()), strict=True)
        return [value for at, value in pairs if from_s <= at <= to_s]

    def mean(self, name: str, from_s: float, to_s: float) -> float:
        """Their mean; 0 without any."""
        values = self.between(name, from_s, to_s)
        return sum(values) / len(values) if values else 0.0

    async def watch(self) -> None:
        """Look every second, until cancelled."""
        self._began_s = self.simulator.clock.monotonic_s()
        me, clock = Probe(os.getpid()), self.simulator.clock
        before_s, before, mine = clock.monotonic_s(), self.look(), me.look()
        whole = psutil.cpu_times()
        sent = received = frames = 0
        while True:
            due_s = before_s + LOOK_S
            await asyncio.sleep(max(0.0, due_s - clock.monotonic_s()))
            now_s = clock.monotonic_s()
            span_s, late_s, before_s = now_s - before_s, now_s - due_s, now_s
            self.late_s.add(max(0.0, late_s))
            after, mine_now, whole_now = self.look(), me.look(), psutil.cpu_times()
            before, self._born = self._born or before, None
            used_s = _used_s(before, after)
            self.gateway_cpu_s += used_s
            own_s = _used_s(mine, mine_now)
            traffic, counts = self.simulator.traffic, self.simulator.counts
            acks = counts.take_recent()
            self._add(
                t=self.now_s,
                gateway_cores=used_s / span_s,
                simulator_cores=own_s / span_s,
                foreign_cores=max(0.0, _busy_s(whole, whole_now) - used_s - own_s) / span_s,
                gateway_rss=after.rss_bytes if after is not None else 0,
                gateway_fds=after.fds if after is not None else 0,
                links=counts.up,
                ack_p50_ms=acks.quantile_s(0.5) * 1000,
                ack_p99_ms=acks.quantile_s(0.99) * 1000,
                sent_bytes_per_s=(traffic.sent_bytes - sent) / span_s,
                received_bytes_per_s=(traffic.received_bytes - received) / span_s,
                frames_per_s=(traffic.sent_frames + traffic.received_frames - frames) / span_s,
                simulator_late_ms=late_s * 1000,
                load_average=os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0,
            )
            sent, received, frames = traffic.sent_bytes, traffic.received_bytes, traffic.sent_frames
            frames += traffic.received_frames
            before, mine, whole = after, mine_now, whole_now
            self._progress()

    async def ask(self, *, every_s: float = 0.5) -> None:
        """Ask the gateway's health over HTTP, as a load balancer would: what its event loop keeps others waiting."""
        while True:
            began_s = self.simulator.clock.monotonic_s()
            with contextlib.suppress(OSError, TimeoutError, asyncio.IncompleteReadError):
                async with asyncio.timeout(10):
                    reader, writer = await asyncio.open_connection("127.0.0.1", self.gateway.http_port)
                    with contextlib.closing(writer):  # also where the gateway dies or stands still meanwhile
                        writer.write(b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
                        await reader.read()
                    self.answers_s.add(self.simulator.clock.monotonic_s() - began_s)
            await asyncio.sleep(max(0.0, began_s + every_s - self.simulator.clock.monotonic_s()))

    async def end(self) -> None:
        """Stop looking, hang up, end the gateway; the second time nothing happens."""
        tasks, self.tasks = self.tasks, []
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if tasks and sys.stdout.isatty() and not self.setting.quiet:
            print()
        self.simulator.stop()
        await asyncio.to_thread(self.gateway.stop)

    def storage(self) -> dict[str, int]:
        """Bytes of the gateway's data directory: the database with its journal, objects, and all else."""
        folder = self.gateway.data_dir
        database = tree_bytes(folder, lambda path: ".sqlite" in path.name)
        objects = tree_bytes(folder / "objects") if (folder / "objects").exists() else 0
        return {"database": database, "objects": objects, "all": tree_bytes(folder)}

    def pss(self) -> int:
        """The gateway's memory, shared pages in parts."""
        return pss_bytes(self.gateway.pid) if self.gateway.running else 0

    def _add(self, **values: float) -> None:
        for name, value in values.items():
            self.series.setdefault(name, []).append(round(value, 4))

    def _progress(self) -> None:
        if self.setting.quiet:
            return
        last = {name: values[-1] for name, values in self.series.items()}
        counts = self.simulator.counts
        text = (
            f"{last['t']:5.0f} s  links {counts.up:,}/{len(self.simulator.robots):,}  "
            f"gateway {last['gateway_cores']:.2f} cores "
            f"{last['gateway_rss'] / 2**20:,.0f} MiB  simulator {last['simulator_cores']:.2f}  "
            f"acks p50 {last['ack_p50_ms']:.0f} p99 {last['ack_p99_ms']:.0f} ms  "
            f"{last['frames_per_s']:,.0f} frames/s  refused {counts.goodbyes.total():,}"
        )
        print(f"\r{text:<150}" if sys.stdout.isatty() else text, end="" if sys.stdout.isatty() else "\n", flush=True)


def _used_s(before: Look | None, after: Look | None) -> float:
    """CPU between two looks; of a process that is another one by now, all it has used."""
    if after is None:
        return 0.0
    return after.cpu_s - before.cpu_s if before is not None and after.cpu_s >= before.cpu_s else after.cpu_s


def _busy_s(before: Any, after: Any) -> float:
    idle = (after.idle - before.idle) + (getattr(after, "iowait", 0.0) - getattr(before, "iowait", 0.0))
    return float(sum(after[:8]) - sum(before[:8]) - idle)


@asynccontextmanager
async def running(setting: Setting, figures: dict[str, Any]) -> AsyncIterator[Run]:
    """A gateway in a fresh folder and a simulator without robots; both end, and the folder goes, whatever happens.

    The run's series are in `figures` from the beginning, so that an interrupted run keeps them.
    """
    with tempfile.TemporaryDirectory(prefix="fleet-", ignore_cleanup_errors=True) as name:
        options = [*setting.gateway_options, *(("--store", setting.store_url) if setting.store_url else ())]
        gateway = GatewayProcess(Path(name), options, core=setting.core, warm=setting.warm)
        port = gateway.http_port if setting.transport == "ws" else gateway.grpc_port
        simulator = Simulator(host="127.0.0.1", port=port, transport=setting.transport, rng=Random(setting.seed))
        run = Run(gateway, simulator, setting)
        figures |= {"series": run.series, "marks": run.marks}
        try:
            await asyncio.to_thread(run.start_gateway)
            run.tasks = [asyncio.create_task(run.watch()), asyncio.create_task(run.ask())]
            await asyncio.sleep(0)
            yield run
        finally:
            await run.end()
