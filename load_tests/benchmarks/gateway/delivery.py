"""From the agent to the gateway's disk: durable samples a second, and what live samples feel of it.

Two processes, as on a robot and in a cloud: one feeds the agent's real outbox, writer and uplink, the other is the real
gateway. A round ends when the last sample is acknowledged: synced on both sides. The outbox alone is the yardstick, as
it is what a robot pays anyway. Then live samples are timed from the outbox's entry to a viewer's socket, alone and
beside durable traffic.

    python -m load_tests delivery [--samples 300000] [--rounds 5] [--quick]
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

from edge_agent.outbox import Outbox
from load_tests.figures import note
from metaros.executor.switch_interval import SWITCH_INTERVAL_S, shorten_switch_interval
from tests.support.gateways.viewer import open_socket, records, subscribe
from tests.support.robots.load_robot import LoadRobot, RobotConfig
from tests.support.servers.postgres import PostgresServer, postgres_binaries
from tests.support.waiting import wait_until_async

__all__ = ["main"]

SIZE_BYTES = 256
BURST = 512
GOAL = 150_000
BEHIND_BYTES = 8 * 1024 * 1024  # what may wait for the feeder's disk
LIVE_EVERY_S = 0.002
GATEWAY = """import typer
from gateway.cli.gateway import register
app = typer.Typer()
app.callback()(lambda: None)
register(app)
app()"""


class Feeder(LoadRobot):
    """The agent's side of a round."""

    outbox_type = Outbox

    async def measure(self, samples: int) -> dict[str, float]:
        """Feed so many, until all are synced here and, with a gateway, acknowledged."""
        tasks = [asyncio.create_task(self.writer.run())]
        if self.config.gateway != NOWHERE:
            tasks.append(asyncio.create_task(self.uplink.run()))
            await wait_until_async(lambda: self.outbox.online, timeout_s=30)
        began, cpu = time.perf_counter(), time.process_time()
        await self.pour(samples)
        await wait_until_async(lambda: not self.behind(), timeout_s=120, every_s=0.001)
        took, cpu = time.perf_counter() - began, time.process_time() - cpu
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        return {"rate": samples / took, "cpu_us": cpu / samples * 1e6, "lost": self.outbox.lost["bulk"]}

    async def pour(self, samples: int) -> None:
        """As fast as the disk takes it."""
        data, stream = bytes(SIZE_BYTES), self.streams["bulk"]
        for start in range(0, samples, BURST):
            stamp_ns = time.time_ns()
            for _ in range(min(BURST, samples - start)):
                self.outbox.append(stream, "bulk", stamp_ns, data)
            self.writer.wake()
            await asyncio.sleep(0)
            await wait_until_async(self.has_room, timeout_s=60, every_s=0.0005)

    def has_room(self) -> bool:
        """Whether the disk keeps up."""
        return sum(pending.size_bytes for pending in self.outbox._pending.values()) < BEHIND_BYTES

    def behind(self) -> bool:
        """Whether something is not where it is to go."""
        if self.config.gateway != NOWHERE:
            return self.waiting()
        return any(self.outbox.due_s(name) is not None for name in self.outbox.logs) or bool(self.outbox._writing)

    async def live(self, seconds: float, durable_per_s: int) -> dict[str, float]:
        """Live samples at a steady pace, with durable ones beside them."""
        tasks = [asyncio.create_task(self.writer.run()), asyncio.create_task(self.uplink.run())]
        channel = next(channel for channel in self.queues.channels if channel.topic == "/load/metric")
        per_turn, data, stream = round(durable_per_s * LIVE_EVERY_S), bytes(SIZE_BYTES), self.streams["bulk"]
        began = due = time.perf_counter()
        while due < began + seconds:
            due += LIVE_EVERY_S
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            for _ in range(per_turn):
                self.outbox.append(stream, "bulk", time.time_ns(), data)
            self.writer.wake()
            self.queues.live.append(channel, time.time_ns(), data)
            self.queues.linger.add(SIZE_BYTES, time.monotonic())
            self.uplink.wake()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        return {}


NOWHERE = "127.0.0.1:9"


def feed(arguments: list[str]) -> int:
    """The feeder's process: prints its figures as JSON."""
    folder, gateway, what, *numbers = arguments
    shorten_switch_interval(SWITCH_INTERVAL_S)  # as the agent does
    config = RobotConfig(folder=Path(folder), state_dir=Path(folder) / "state", gateway=gateway, life=0)

    async def run() -> dict[str, float]:
        feeder = Feeder(config)
        if what == "live":
            return await feeder.live(float(numbers[0]), int(numbers[1]))
        return await feeder.measure(int(numbers[0]))

    print(json.dumps(asyncio.run(run())))
    return 0


def feeder(folder: Path, gateway: str, *what: object) -> subprocess.Popen[str]:
    """Start the feeder."""
    command = [
        sys.executable,
        "-m",
        "load_tests.benchmarks.gateway.delivery",
        "--feed",
        str(folder),
        gateway,
        *map(str, what),
    ]
    quiet = {**os.environ, "GRPC_VERBOSITY": "ERROR"}
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=quiet)


@contextmanager
def running_gateway(folder: Path, *options: str) -> Iterator[tuple[psutil.Process, dict[str, Any]]]:
    """A gateway process, and its status."""
    status = folder / "status.json"
    command = [
        sys.executable,
        "-c",
        GATEWAY,
        "gateway",
        "--port",
        "0",
        "--grpc-port",
        "0",
        "--robot-messages-per-s",
        "0",
        "--robot-bytes-per-s",
        "0",
        "--status-file",
        str(status),
    ]
    process = subprocess.Popen([*command, "--data-dir", str(folder / "data"), *options], stdout=subprocess.DEVNULL)
    try:
        while not status.exists() and process.poll() is None:
            time.sleep(0.02)
        yield psutil.Process(process.pid), json.loads(status.read_text())
    finally:
        process.terminate()
        process.wait(20)


def one_round(kind: str, samples: int) -> dict[str, float]:
    """Fresh directories, one feeder, and what `kind` says behind it."""
    with tempfile.TemporaryDirectory(prefix="bench-delivery-") as name:
        folder = Path(name)
        if kind == "outbox alone":
            return finish(feeder(folder, NOWHERE, "measure", samples))
        server = PostgresServer(durable=True) if kind == "PostgreSQL" else None
        try:
            if server is not None:
                server.start()
            options = ("--store", server.url) if server is not None else ()
            with running_gateway(folder, *options) as (process, status):
                before = sum(process.cpu_times()[:2])
                facts = finish(feeder(folder, f"127.0.0.1:{status['grpc_port']}", "measure", samples))
                facts["gateway_us"] = (sum(process.cpu_times()[:2]) - before) / samples * 1e6
                return facts
        finally:
            if server is not None:
                server.close()


def finish(process: subprocess.Popen[str]) -> dict[str, float]:
    """Its figures."""
    output, _ = process.communicate(timeout=300)
    return dict(json.loads(output.strip().splitlines()[-1]))


def live_round(seconds: float, durable_per_s: int) -> list[float]:
    """Milliseconds from the outbox's entry to a viewer, of every live sample after the first half second."""
    late: list[float] = []
    with tempfile.TemporaryDirectory(prefix="bench-delivery-") as name:
        folder = Path(name)
        with running_gateway(folder) as (_, status):
            with open_socket(status["url"], "/api/v1/stream") as socket:
                subscribe(socket, 1, "*", "/load/metric", mode="queue")
                process = feeder(folder, f"127.0.0.1:{status['grpc_port']}", "live", seconds, durable_per_s)
                try:
                    while process.poll() is None:
                        try:
                            frame = socket.recv(timeout=0.2)
                        except TimeoutError:
                            continue
                        now_ns = time.time_ns()
                        if isinstance(frame, bytes):
                            late += [(now_ns - record.stamp_ns) / 1e6 for record in records(frame)]
                finally:
                    process.kill()
                    process.communicate()
    return late[round(0.5 / LIVE_EVERY_S) :]


def bench_durable(samples: int, rounds: int) -> None:
    """The table of samples a second."""
    kinds = ["outbox alone", "SQLite", *(["PostgreSQL"] if postgres_binaries() is not None else [])]
    found: dict[str, list[dict[str, float]]] = {kind: [] for kind in kinds}
    for _ in range(rounds):  # interleaved, so that a busy moment hits all
        for kind in kinds:
            found[kind].append(one_round(kind, samples))
    print(f"durable samples of {SIZE_BYTES} B, {samples:,} a round, median of {rounds} (least to most)")
    print(
        f"  {'':14} {'samples/s':>10} {'spread':>21} {'of outbox':>10} {'agent us':>9} {'gateway us':>11} {'lost':>5}"
    )
    alone = statistics.median(facts["rate"] for facts in found["outbox alone"])
    for kind, facts in found.items():
        rates = sorted(fact["rate"] for fact in facts)
        median = statistics.median(rates)
        spread = f"{rates[0]:,.0f} to {rates[-1]:,.0f}"
        note(
            f"samples, {kind}", [fact["rate"] for fact in facts], peer=[fact["rate"] for fact in found["outbox alone"]]
        )
        agent, gateway = (statistics.median(fact.get(key, 0.0) for fact in facts) for key in ("cpu_us", "gateway_us"))
        lost = sum(fact["lost"] for fact in facts)
        share = f"{median / alone:.0%}"
        print(f"  {kind:14} {median:>10,.0f} {spread:>21} {share:>10} {agent:>9.2f} {gateway:>11.2f} {lost:>5.0f}")
        if kind != "outbox alone":
            print(f"  {'':14} goal {GOAL:,}: {'reached' if median >= GOAL else 'not reached'}")


def bench_live(seconds: float, rounds: int) -> None:
    """The table of live latencies."""
    loads = {"alone": 0, "beside 20,000 durable/s": 20_000, "beside 60,000 durable/s": 60_000}
    late: dict[str, list[list[float]]] = {load: [] for load in loads}
    for _ in range(rounds):
        for load, durable_per_s in loads.items():
            late[load].append(live_round(seconds, durable_per_s))
    print(f"live samples of {SIZE_BYTES} B, {1 / LIVE_EVERY_S:.0f}/s, agent to viewer; linger 5 ms, tick 5 ms; ms")
    for load, runs in late.items():
        whole = [run for run in runs if len(run) > 100]
        if whole:
            note(f"live p99, {load}", [statistics.quantiles(run, n=100)[-1] for run in whole])
            middle = statistics.median(statistics.median(run) for run in whole)
            tail = statistics.median(statistics.quantiles(run, n=100)[-1] for run in whole)
            print(f"  {load:24} p50 {middle:>7.2f}  p99 {tail:>7.2f}  ({sum(map(len, whole)):,} samples)")
        else:
            print(f"  {load:24} too few arrived")


def main(argv: list[str] | None = None) -> int:
    """Run both tables."""
    arguments = sys.argv[1:] if argv is None else argv
    if arguments[:1] == ["--feed"]:
        return feed(arguments[1:])
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=300_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=4.0, help="of each live round")
    parser.add_argument("--quick", action="store_true", help="one short round, to see that it runs")
    options = parser.parse_args(arguments)
    if options.quick:
        options.samples, options.rounds, options.seconds = 40_000, 1, 2.0
    bench_durable(options.samples, options.rounds)
    bench_live(options.seconds, options.rounds)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
