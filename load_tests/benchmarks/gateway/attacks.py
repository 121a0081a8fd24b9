"""What an honest client of a gateway notices while somebody attacks it.

A gateway process; in this process a robot that sends a live sample every 20 ms over one agent link, a viewer with the
stream, and a client that asks for the robot every 20 ms; the last two have signed in. For every attack, rounds without
and with it take turns; the attacker is a process of its own with a lower priority (see `attack_programs`). Printed are
medians over the rounds of each round's p50 and p99, the median of the rounds' p99 ratios, and how much the gateway's
memory grew.

    python -m load_tests attacks [--rounds 5] [--seconds 4] [--only login,pings]
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import psutil
from websockets.asyncio.client import ClientConnection, connect

from load_tests.benchmarks.gateway.attack_programs import ATTACKS
from load_tests.benchmarks.gateway.ingest import GATEWAY
from load_tests.figures import note
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.link import pack_batch

PERIOD_S = 0.02
SETTLE_S = 1.0
GOAL = 2.0


@dataclass
class Seen:
    """Milliseconds of one round."""

    requests: list[float] = field(default_factory=list)
    samples: list[float] = field(default_factory=list)
    refused: int = 0


class Honest:
    """A client, a viewer and a robot of one gateway."""

    def __init__(self, http_port: int, grpc_port: int, *, key: str) -> None:
        self._http_port, self._grpc_port, self._key = http_port, grpc_port, key
        self.seen = Seen()

    @contextlib.asynccontextmanager
    async def at_work(self) -> AsyncIterator[Honest]:
        """Robot, viewer and client, until the end."""
        async with grpc.aio.insecure_channel(f"127.0.0.1:{self._grpc_port}") as channel:
            lanes = [await self._lane(channel, lane) for lane in (link_pb2.LANE_CONTROL, link_pb2.LANE_DATA)]
            headers = {"Authorization": f"Bearer {self._key}"}
            url = f"ws://127.0.0.1:{self._http_port}/api/v1/stream"
            async with connect(url, max_size=None, compression=None, proxy=None, additional_headers=headers) as socket:
                asked = {"op": "subscribe", "id": 1, "robots": "honest", "topics": "/**"}
                await socket.send(json.dumps(asked))
                jobs = [self._robot(*lanes), self._view(socket), self._ask(), *(self._listen(lane) for lane in lanes)]
                tasks = [asyncio.create_task(job) for job in jobs]
                try:
                    yield self
                finally:
                    for task in tasks:
                        task.cancel()
                    for ended in await asyncio.gather(*tasks, return_exceptions=True):
                        if ended is not None and not isinstance(ended, asyncio.CancelledError):
                            print(f"an honest part ended: {ended!r}", file=sys.stderr)

    async def round(self, seconds: float) -> Seen:
        """What is seen in so long."""
        self.seen = seen = Seen()
        await asyncio.sleep(seconds)
        return seen

    async def _lane(self, channel: grpc.aio.Channel, lane: Any) -> Any:
        call = link_pb2_grpc.LinkStub(channel).Connect()
        hello = link_pb2.Hello(
            protocol=1, robot_id="honest", session_id=bytes(16), session_number=1, lane=lane, namespace="/"
        )
        await call.write(link_pb2.AgentFrame(hello=hello))
        await call.read()
        announced = link_pb2.Channel(channel_id=1, topic="/live", schema_name="a/msg/B", forward=True)
        setattr(announced, "class", link_pb2.DELIVERY_CLASS_LIVE)
        await call.write(link_pb2.AgentFrame(announce=link_pb2.Announce(channels=[announced])))
        return call

    async def _robot(self, control: Any, data: Any) -> None:
        sequence, beat_s = 0, 0.0
        async for now_s in _ticks():
            sequence += 1
            payload = np.float64(time.perf_counter()).tobytes() + bytes(192)
            batch = pack_batch(1, 1, sequence, [time.time_ns()], [payload])
            await data.write(link_pb2.AgentFrame(batches=link_pb2.Batches(batches=[batch])))
            if now_s - beat_s > 1.0:
                beat_s = now_s
                for lane in (control, data):
                    await lane.write(link_pb2.AgentFrame(heartbeat=link_pb2.Heartbeat()))

    async def _listen(self, lane: Any) -> None:
        while await lane.read() is not grpc.aio.EOF:
            pass

    async def _view(self, socket: ClientConnection) -> None:
        async for message in socket:
            if isinstance(message, bytes):
                sent_s = float(np.frombuffer(message[-200:-192], "<f8")[0])
                self.seen.samples.append((time.perf_counter() - sent_s) * 1000)

    async def _ask(self) -> None:
        """One connection; what is cut off or refused is counted, and asked again on a new one."""
        text = f"GET /api/v1/robots/honest HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {self._key}\r\n\r\n"
        request = text.encode()
        while True:
            reader, writer = await asyncio.open_connection("127.0.0.1", self._http_port)
            with contextlib.suppress(OSError, EOFError):
                async for _ in _ticks():
                    start = time.perf_counter()
                    writer.write(request)
                    head = await reader.readuntil(b"\r\n\r\n")
                    length = next(line for line in head.split(b"\r\n") if line.startswith(b"content-length:"))
                    await reader.readexactly(int(length.split(b":")[1]))
                    self.seen.requests.append((time.perf_counter() - start) * 1000)
                    self.seen.refused += not head.startswith(b"HTTP/1.1 200")
            self.seen.refused += 1
            writer.close()


async def _ticks() -> AsyncIterator[float]:
    next_s = time.perf_counter()
    while True:
        next_s = max(next_s + PERIOD_S, time.perf_counter())
        await asyncio.sleep(max(0.0, next_s - time.perf_counter()))
        yield next_s


@contextlib.contextmanager
def attack(name: str, http_port: int, grpc_port: int) -> Any:
    """The attacker's process."""
    command = [
        sys.executable,
        "-m",
        "load_tests.benchmarks.gateway.attack_programs",
        name,
        str(http_port),
        str(grpc_port),
    ]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait(10)


def percentile(values: list[float], share: float) -> float:
    """In milliseconds; infinite where nothing came at all."""
    return float(np.percentile(values, share * 100)) if values else float("inf")


@dataclass
class Row:
    """An attack's rounds: (without, with) each."""

    rounds: list[tuple[Seen, Seen]] = field(default_factory=list)
    grown_mib: float = 0.0

    def figures(self, part: str) -> tuple[float, float, float, float, float]:
        """Medians over the rounds: p50 without and with, p99 without and with, and the ratio of the p99s."""
        found = [
            tuple(percentile(getattr(seen, part), share) for share in (0.5, 0.99) for seen in pair)
            for pair in self.rounds
        ]
        quiet50, with50, quiet99, with99 = (statistics.median(column) for column in zip(*found, strict=True))
        return quiet50, with50, quiet99, with99, statistics.median(row[3] / row[2] for row in found)

    @property
    def refused(self) -> int:
        """How often the honest client was refused or cut off."""
        return sum(attacked.refused for _, attacked in self.rounds)


async def measure(names: list[str], *, rounds: int, seconds: float, folder: Path, nice: int = 0) -> dict[str, Row]:
    """Every attack in every round, each after a quiet stretch."""
    process, status = await asyncio.to_thread(start_gateway, folder)
    for number in (process.pid, os.getpid()):
        os.setpriority(os.PRIO_PROCESS, number, nice)
    ports = status["http_port"], status["grpc_port"]
    watched = psutil.Process(process.pid)
    rows = {name: Row() for name in names}
    try:
        key = (folder / "data" / "local.key").read_text().strip()
        async with Honest(*ports, key=key).at_work() as honest:
            await honest.round(SETTLE_S)
            for number in range(rounds):
                for name in names:
                    before = watched.memory_info().rss
                    quiet = await honest.round(seconds)
                    with attack(name, *ports):
                        await honest.round(2 * SETTLE_S)
                        attacked = await honest.round(seconds)
                        grown = (watched.memory_info().rss - before) / 2**20
                    await honest.round(SETTLE_S)
                    rows[name].rounds.append((quiet, attacked))
                    rows[name].grown_mib = max(rows[name].grown_mib, grown)
                print(f"round {number + 1} of {rounds}", file=sys.stderr, flush=True)
    finally:
        process.terminate()
        await asyncio.to_thread(process.wait, 20)
    return rows


def start_gateway(folder: Path) -> tuple[subprocess.Popen[bytes], dict[str, Any]]:
    """A gateway process with its usual limits, as it is beyond loopback: who has not signed in is a stranger."""
    status = folder / "status.json"
    command = [sys.executable, "-c", GATEWAY, "gateway", "--port", "0", "--grpc-port", "0", "--no-anonymous"]
    command += ["--data-dir", str(folder / "data"), "--status-file", str(status)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=(folder / "log").open("wb"))
    while not status.exists():
        time.sleep(0.05)
    return process, dict(json.loads(status.read_text()))


def show(rows: dict[str, Row]) -> bool:
    """Print the table; whether every ratio is under the goal."""
    parts = "  ".join(f"{part + ' p50 ms':>15}  {part + ' p99 ms':>15}  ratio" for part in ("REST", "live"))
    print(f"{'attack':12}  {parts}")
    good = True
    for name, row in rows.items():
        texts, worst = [], 0.0
        for part in ("requests", "samples"):
            quiet50, with50, quiet99, with99, ratio = row.figures(part)
            texts.append(f"{quiet50:6.1f} > {with50:6.1f}  {quiet99:6.1f} > {with99:6.1f}  {ratio:5.2f}")
            good, worst = good and ratio < GOAL, max(worst, ratio)
        note(f"{name}: p99 with ÷ without", [worst])
        more = f"  +{row.grown_mib:.0f} MiB" + (f"  {row.refused} refused" if row.refused else "")
        print(f"{name:12}  {texts[0]}  {texts[1]}{more}")
    return good


def main(argv: list[str] | None = None) -> int:
    """Read the options and run; 1 when a p99 grew to twice or more."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument(
        "--nice", type=int, default=0, help="of gateway and honest clients: -10 shields them from what else runs here"
    )
    parser.add_argument("--only", default=",".join(ATTACKS))
    options = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        work = measure(
            options.only.split(","),
            rounds=options.rounds,
            seconds=options.seconds,
            folder=Path(folder),
            nice=options.nice,
        )
        rows = asyncio.run(work)
    return int(not show(rows))


if __name__ == "__main__":
    raise SystemExit(main())
