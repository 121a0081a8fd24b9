"""How fast one gateway takes in what robots send, durable to the acknowledgement: rows of series and opaque samples.

A gateway process, and in this process robots that keep a window of batches in flight over real gRPC. A run ends when
the last batch is acknowledged, that is, after its commit was synced. CPU is the gateway's own. In turns with it a bare
gRPC server acknowledges the same frames and does nothing with them: no gateway in Python passes that.

    python -m load_tests ingest [--robots 4] [--seconds 3] [--rounds 5]
"""

from __future__ import annotations

import argparse
import asyncio
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import psutil

from load_tests.figures import note
from metaros._proto import link_pb2, link_pb2_grpc

WINDOW = 64
EPOCH = 1
GATEWAY = """import typer
from gateway.cli.gateway import register
app = typer.Typer()
app.callback()(lambda: None)
register(app)
app()"""


class Robot:
    """One robot's two lanes."""

    def __init__(self, target: str, name: str) -> None:
        self._target, self._name = target, name
        self._acked = asyncio.Event()
        self._stored = 0
        self._channels: list[Any] = []
        self._data: Any = None

    async def open(self) -> None:
        """Say hello on both lanes and announce one channel and one series."""
        for lane in (link_pb2.LANE_CONTROL, link_pb2.LANE_DATA):
            channel = grpc.aio.insecure_channel(self._target)
            call = link_pb2_grpc.LinkStub(channel).Connect()
            hello = link_pb2.Hello(
                protocol=1, robot_id=self._name, session_id=bytes(16), session_number=1, lane=lane, namespace="/"
            )
            await call.write(link_pb2.AgentFrame(hello=hello))
            await call.read()
            self._channels.append(channel)
            self._data = call
        announced = link_pb2.Channel(channel_id=1, topic="/bulk", schema_name="a/msg/B", forward=True)
        setattr(announced, "class", link_pb2.DELIVERY_CLASS_BULK)
        series = [link_pb2.Series(series_id=n + 1, name=f"s{n}") for n in range(50)]
        await self._data.write(link_pb2.AgentFrame(announce=link_pb2.Announce(channels=[announced], series=series)))

    async def close(self) -> None:
        """Hang up."""
        for channel in self._channels:
            await channel.close()

    async def run(self, kind: str, seconds: float, per_batch: int) -> int:
        """Send for a while with a window of batches, wait for the last ack; returns how many were stored."""
        self._stored = 0
        reader = asyncio.create_task(self._read())
        frame, batch = _frame(kind, per_batch)
        sent, end = 0, time.perf_counter() + seconds
        while time.perf_counter() < end:
            while sent - self._stored >= WINDOW * per_batch:
                self._acked.clear()
                await self._acked.wait()
            batch.first_seq = sent + 1
            batch.epoch = EPOCH if kind == "rows" else EPOCH + 1
            await self._data.write(frame)
            sent += per_batch
        while self._stored < sent:
            self._acked.clear()
            await self._acked.wait()
        reader.cancel()
        return sent

    async def _read(self) -> None:
        while (frame := await self._data.read()) is not grpc.aio.EOF:
            for mark in frame.ack.watermarks:
                self._stored = mark.seq
                self._acked.set()


def _frame(kind: str, per_batch: int) -> tuple[link_pb2.AgentFrame, Any]:
    stamps = np.arange(per_batch, dtype="<i8").tobytes()
    if kind == "rows":
        series = (np.arange(per_batch, dtype="<u4") % 50 + 1).tobytes()
        values = np.random.default_rng(1).normal(size=per_batch).tobytes()
        frame = link_pb2.AgentFrame(
            metrics=link_pb2.MetricBatch(count=per_batch, series_ids=series, stamps=stamps, values=values)
        )
        return frame, frame.metrics
    lengths = np.full(per_batch, 256, "<u4").tobytes()
    batch = link_pb2.Batch(stream_id=1, count=per_batch, stamps=stamps, lengths=lengths, payload=bytes(256 * per_batch))
    frame = link_pb2.AgentFrame(batches=link_pb2.Batches(batches=[batch]))
    return frame, frame.batches.batches[0]


def start_server(folder: Path, *, bare: bool) -> tuple[subprocess.Popen[bytes], str]:
    """A gateway process, or the bare server's, and where robots reach it."""
    status = folder / "status.json"
    command = [sys.executable, "-c", GATEWAY, "gateway", "--port", "0", "--grpc-port", "0"]
    command += ["--robot-messages-per-s", "0", "--robot-bytes-per-s", "0"]
    command += ["--data-dir", str(folder / "data"), "--status-file", str(status)]
    if bare:
        command = [sys.executable, "-m", "load_tests.benchmarks.gateway.ingest", "--bare", str(status)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    while not status.exists():
        time.sleep(0.05)
    return process, f"127.0.0.1:{json.loads(status.read_text())['grpc_port']}"


class Bare(link_pb2_grpc.LinkServicer):
    """Acknowledges what comes, and stores nothing."""

    async def Connect(self, request_iterator: Any, context: Any) -> None:
        """One lane."""
        async for frame in request_iterator:
            kind = frame.WhichOneof("frame")
            if kind == "hello":
                await context.write(link_pb2.GatewayFrame(welcome=link_pb2.Welcome()))
            elif kind != "announce":
                batch = frame.metrics if kind == "metrics" else frame.batches.batches[0]
                seq = batch.first_seq + batch.count - 1
                mark = link_pb2.Watermark(stream_id=batch.stream_id, epoch=batch.epoch, seq=seq)
                await context.write(link_pb2.GatewayFrame(ack=link_pb2.Ack(watermarks=[mark])))


async def serve_bare(status: Path) -> None:
    """The bare server, until it is ended."""
    server = grpc.aio.server()
    link_pb2_grpc.add_LinkServicer_to_server(Bare(), server)
    port = server.add_insecure_port("127.0.0.1:0")
    await server.start()
    status.with_suffix(".new").write_text(json.dumps({"grpc_port": port}))
    status.with_suffix(".new").rename(status)
    await server.wait_for_termination()


async def one_round(
    kind: str, process: subprocess.Popen[bytes], target: str, *, robots: int, seconds: float, per_batch: int
) -> tuple[float, float]:
    """(stored a second by the clock, stored a second of gateway CPU)."""
    fleet = [Robot(target, f"r{n}") for n in range(robots)]
    for robot in fleet:
        await robot.open()
    watched = psutil.Process(process.pid)
    before, start = watched.cpu_times(), time.perf_counter()
    total = sum(await asyncio.gather(*(robot.run(kind, seconds, per_batch) for robot in fleet)))
    took, after = time.perf_counter() - start, watched.cpu_times()
    for robot in fleet:
        await robot.close()
    return total / took, total / (after.user + after.system - before.user - before.system)


async def measure(kind: str, per_batch: int, *, robots: int, seconds: float, rounds: int) -> None:
    """Some rounds, each with a new gateway and store; prints medians with their spread."""
    walls: dict[bool, list[float]] = {False: [], True: []}
    cores = []
    for bare in [False, True] * rounds:
        with tempfile.TemporaryDirectory() as folder:
            process, target = await asyncio.to_thread(start_server, Path(folder), bare=bare)
            try:
                wall, core = await one_round(kind, process, target, robots=robots, seconds=seconds, per_batch=per_batch)
            finally:
                process.terminate()
                await asyncio.to_thread(process.wait, 10)
        walls[bare].append(wall)
        cores += [core] if not bare else []
    note(kind, walls[False], peer=walls[True])
    print(
        f"{kind}: {statistics.median(walls[False]):,.0f}/s by the clock ({min(walls[False]):,.0f} to "
        f"{max(walls[False]):,.0f}), {statistics.median(cores):,.0f} a second of gateway CPU; "
        f"bare gRPC {statistics.median(walls[True]):,.0f}/s; batches of {per_batch}, {robots} robots"
    )


async def measure_all(*, robots: int, seconds: float, rounds: int) -> None:
    """Both kinds in one event loop: grpc.aio has one poller a process."""
    for kind, per_batch in (("rows", 700), ("samples", 200)):
        await measure(kind, per_batch, robots=robots, seconds=seconds, rounds=rounds)


def main(argv: Sequence[str] = ()) -> int:
    """Read the options and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--bare", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(list(argv))
    if options.bare is not None:
        asyncio.run(serve_bare(options.bare))
        return 0
    asyncio.run(measure_all(robots=options.robots, seconds=options.seconds, rounds=options.rounds))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
