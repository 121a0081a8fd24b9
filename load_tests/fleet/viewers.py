"""`viewers`: people who watch live topics of many robots; how old samples are when they come, what is dropped."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException

from load_tests.fleet.conclude import conclude, fresh, gateway_figures, goal
from load_tests.fleet.figures import Histogram
from load_tests.fleet.load import Load
from load_tests.fleet.run import Run, Setting, running
from load_tests.fleet.steady import kept
from tests.support.gateways.viewer import HEADER

__all__ = ["viewers"]

UP_S = 60.0
READ_BYTES = 4096  # of the stalled viewer's socket: the gateway's queue, not the kernel, is what fills
STALL_P99_MS = 250.0


class Watcher:
    """One viewer of one robot's live topic; every record is counted, its age taken by the clock of both, this one."""

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self.samples = self.missed = self.dropped = 0
        self._seq = 0

    def take(self, frame: bytes, now_ns: int, *into: Histogram) -> None:
        """All records of a binary message."""
        at = 0
        while at < len(frame):
            size, _, _, _, seq, stamp_ns, _ = HEADER.unpack_from(frame, at)
            self.samples += 1
            if self._seq and seq > self._seq + 1:
                self.missed += seq - self._seq - 1
            self._seq = max(self._seq, seq)
            for histogram in into:
                histogram.add((now_ns - stamp_ns) / 1e9)
            at += size


class Audience:
    """All viewers of a run, in this process."""

    def __init__(self, run: Run) -> None:
        self.age_s, self.recent_s = Histogram(), Histogram()
        self.watchers: list[Watcher] = []
        self.failed: list[str] = []
        self._url = f"ws://127.0.0.1:{run.gateway.http_port}/api/v1/stream"

    async def open(self, robot: str, *, limit: int = 2**20) -> ClientConnection:
        """Connect and ask for every sample of a robot's live topic."""
        socket = await connect(self._url, max_size=None, compression=None, proxy=None, max_queue=limit, open_timeout=30)
        asked = {"op": "subscribe", "id": 1, "robots": robot, "topics": "/load/live", "mode": "queue"}
        await socket.send(json.dumps(asked))
        return socket

    async def watch(self, robot: str) -> None:
        """Read until cancelled."""
        watcher = Watcher(robot)
        self.watchers.append(watcher)
        try:
            async with await self.open(robot) as socket:
                async for message in socket:
                    if isinstance(message, bytes):
                        watcher.take(message, time.time_ns(), self.age_s, self.recent_s)
                    elif (reported := json.loads(message))["op"] == "dropped":
                        watcher.dropped += reported["count"]
        except (OSError, WebSocketException, TimeoutError) as error:
            self.failed.append(f"a viewer of {robot} ended: {type(error).__name__}")

    async def stall(self, robot: str, *, most_s: float) -> float:
        """A viewer that never reads; after how many seconds the gateway cut it, -1 where it did not in so long."""
        reader, writer = await asyncio.open_connection(
            "127.0.0.1", int(self._url.split(":")[2].split("/")[0]), limit=256
        )
        with contextlib.suppress(OSError):
            raw = writer.get_extra_info("socket")
            raw.setsockopt(1, 8, READ_BYTES)  # SO_RCVBUF
        writer.write(
            b"GET /api/v1/stream HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        await reader.readuntil(b"\r\n\r\n")
        asked = json.dumps({"op": "subscribe", "id": 1, "robots": robot, "topics": "/load/live", "mode": "queue"})
        writer.write(b"\x81\xfe" + len(asked).to_bytes(2, "big") + bytes(4) + asked.encode())
        began_s = time.monotonic()
        writer.transport.pause_reading()  # type: ignore[attr-defined]
        try:
            while time.monotonic() - began_s < most_s:
                await asyncio.sleep(0.5)
                try:
                    writer.write(b"\x8a\x80" + bytes(4))  # an empty pong: it shows whether the connection still lives
                    await writer.drain()
                except OSError:
                    return time.monotonic() - began_s
                if writer.transport.is_closing():
                    return time.monotonic() - began_s
            return -1.0
        finally:
            writer.transport.abort()


async def viewers(
    setting: Setting, figures: dict[str, Any], *, robots: int, viewers: int, load: Load, seconds: float, cut_s: float
) -> None:
    """Viewers evenly over robots for `seconds`; then as long again beside one that never reads.

    Whether that one is cut is looked at for `cut_s`.
    """
    figures |= {"robots": robots, "viewers": viewers, "load": load.describe()}
    async with running(setting, figures) as run:
        await run.simulator.join([load] * robots, per_s=100.0)
        await run.simulator.all_up(timeout_s=UP_S)
        audience = Audience(run)
        names = [robot.name for robot in run.simulator.robots]
        watching = []
        for index in range(viewers):
            watching.append(asyncio.create_task(audience.watch(names[index % robots])))
            await asyncio.sleep(0.01)
        series = asyncio.create_task(_series(run, audience))
        await asyncio.sleep(min(3.0, seconds))
        fresh(run)
        audience.age_s, from_s = Histogram(), run.now_s
        counted = sum(watcher.samples for watcher in audience.watchers)
        run.mark("all watch")
        await asyncio.sleep(seconds)
        figures |= gateway_figures(run, from_s, run.now_s)
        figures["deliveries_per_s"] = (sum(w.samples for w in audience.watchers) - counted) / (run.now_s - from_s)
        figures["latency_ms"] = audience.age_s.summary_ms()
        audience.age_s = Histogram()
        run.mark("one never reads")
        stalling = asyncio.create_task(audience.stall(names[0], most_s=cut_s))
        await asyncio.sleep(seconds)
        figures["latency_beside_a_stalled_one_ms"] = audience.age_s.summary_ms()
        figures["stalled_viewer_cut_after_s"] = await stalling
        figures["missed"] = sum(watcher.missed for watcher in audience.watchers)
        figures["told_dropped"] = sum(watcher.dropped for watcher in audience.watchers)
        run.faults += audience.failed
        figures["viewers_lost"] = len(audience.failed)
        for task in (*watching, series):
            task.cancel()
        await asyncio.gather(*watching, series, return_exceptions=True)
        await conclude(run, figures)
    figures["goals"] = [
        goal(not figures["viewers_lost"], f"{figures['viewers_lost']} of {viewers} viewers lost their connection"),
        goal(
            figures["latency_ms"]["p99"] <= STALL_P99_MS,
            f"p99 {figures['latency_ms']['p99']:.0f} ms from a robot to a viewer; goal {STALL_P99_MS:.0f} ms",
        ),
        goal(
            figures["missed"] == figures["told_dropped"],
            f"{figures['missed']} samples did not reach a viewer, who was told of {figures['told_dropped']}",
        ),
        *kept(figures),
    ]


async def _series(run: Run, audience: Audience) -> None:
    """Ages of each second, beside the run's own series, which have a look more or less."""
    names = ("view_p50_ms", "view_p99_ms")
    while True:
        await asyncio.sleep(0.25)
        looks = len(run.series.get("t", ()))
        for name, share in zip(names, (0.5, 0.99), strict=True):
            values = run.series.setdefault(name, [])
            while len(values) < looks:
                values.append(round(audience.recent_s.quantile_s(share) * 1000, 3))
        if looks and audience.recent_s.count > 10_000:
            audience.recent_s = Histogram()
