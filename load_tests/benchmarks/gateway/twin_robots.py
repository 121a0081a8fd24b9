"""Many robots in one process, as far as their twins go: three lanes each over shared gRPC channels, real frames.

    python -m load_tests.benchmarks.gateway.twin_robots PORT COUNT

Prints `up` once every lane is open, and `revision N` whenever all robots live by revision N and have it confirmed.
"""

from __future__ import annotations

import asyncio
import sys
from typing import Any

import grpc

from metaros._proto import link_pb2, link_pb2_grpc
from metaros.fleet.twin import digest

__all__ = ["main"]

CHANNELS = 64  # a server takes 100 streams on one connection
LANES = (link_pb2.LANE_CONTROL, link_pb2.LANE_DATA, link_pb2.LANE_BACKFILL)
OPENING = 64  # robots that connect at a time


class Robot:
    """One link that does what a twin says at once."""

    def __init__(self, fleet: Fleet, name: str) -> None:
        self.fleet = fleet
        self.name = name
        self.applied = 0
        self.document = b"{}"
        self.calls: dict[int, Any] = {}

    async def open(self, stub: link_pb2_grpc.LinkStub) -> None:
        """Say hello on every lane, and report."""
        for lane in LANES:
            call = self.calls[lane] = stub.Connect()
            hello = link_pb2.Hello(
                protocol=1,
                robot_id=self.name,
                session_id=self.name.encode().ljust(16, b"."),
                session_number=1,
                lane=lane,
                agent_version="bench",
                namespace=f"/{self.name}",
                labels={"half": self.name[-1]},
            )
            await call.write(link_pb2.AgentFrame(hello=hello))
            answer = await call.read()
            if answer is grpc.aio.EOF or answer.WhichOneof("frame") != "welcome":
                raise SystemExit(f"{self.name}: no welcome: {answer}")
        await self._report("applied")  # before anybody else writes on the lane: gRPC takes one write at a time
        self.fleet.tasks.update(asyncio.create_task(self._read(lane, call)) for lane, call in self.calls.items())

    async def _report(self, state: str) -> None:
        report = link_pb2.TwinReport(
            revision=self.applied, applied=self.applied, state=state, sha256=digest(self.document), reported=b"{}"
        )
        await self.calls[LANES[0]].write(link_pb2.AgentFrame(twin=report))

    async def _read(self, lane: int, call: Any) -> None:
        while (frame := await call.read()) is not grpc.aio.EOF:
            kind = frame.WhichOneof("frame")
            if kind == "twin" and frame.twin.revision > self.applied:
                self.applied, self.document = frame.twin.revision, frame.twin.document
                await self._report("confirming")
            elif kind == "twin_confirmed":
                await self._report("applied")
                self.fleet.confirmed(frame.twin_confirmed.revision)
            elif kind == "heartbeat":
                beat = link_pb2.Heartbeat(sent_ns=1, echo_ns=frame.heartbeat.sent_ns)
                await call.write(link_pb2.AgentFrame(heartbeat=beat))
            elif kind == "goodbye":
                raise SystemExit(f"{self.name}: {frame.goodbye.message}")


class Fleet:
    """All of them."""

    def __init__(self, port: int, count: int) -> None:
        self.count = count
        self.tasks: set[asyncio.Task[None]] = set()
        self._target = f"127.0.0.1:{port}"
        self._at: dict[int, int] = {}

    def confirmed(self, revision: int) -> None:
        """One more robot lives by it."""
        self._at[revision] = self._at.get(revision, 0) + 1
        if self._at[revision] == self.count:
            print(f"revision {revision}", flush=True)

    async def run(self) -> None:
        """Connect, then do what the gateway says until it hangs up."""
        stubs = [link_pb2_grpc.LinkStub(grpc.aio.insecure_channel(self._target, _own(n))) for n in range(CHANNELS)]
        robots = [Robot(self, f"robot_{number:04}") for number in range(self.count)]
        places = asyncio.Semaphore(OPENING)

        async def one(number: int) -> None:
            async with places:
                await robots[number].open(stubs[number % CHANNELS])

        await asyncio.gather(*(one(number) for number in range(self.count)))
        print("up", flush=True)
        await asyncio.gather(*self.tasks)


def _own(number: int) -> list[tuple[str, Any]]:
    """Options that keep gRPC from making one connection of all channels."""
    return [("bench.channel", number), ("grpc.use_local_subchannel_pool", 1)]


def main(argv: list[str]) -> int:
    """Run until the gateway ends."""
    asyncio.run(Fleet(int(argv[0]), int(argv[1])).run())
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
