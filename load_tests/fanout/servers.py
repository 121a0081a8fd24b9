"""A real gateway in a process of its own, which takes samples from a robot's link or publishes what it is told.

    python -m load_tests.fanout.servers [--tick-ms 5] [--stall-s 10] [--core 0]

Prints its HTTP port and the port of robots; then each line of its input, JSON of a `Load`, is published by itself, as
foxglove-sdk's server does it too: what is due each millisecond, all of it with one stamp, out of one buffer. That
generator is as light as it gets, and what it takes without any viewer is told apart. With a robot (robot.py) nothing
of the kind runs here.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gateway import main as gateway_main
from gateway.domain.channel import Channel
from gateway.domain.robot import Robot
from gateway.domain.sample import Run
from gateway.ingest.registry import RobotRecord
from gateway.main import Ready, new_event_loop, serve
from gateway.server.garbage_collector import tune_garbage_collector
from gateway.settings import Settings
from gateway.wiring.gateway import Gateway
from load_tests.fanout.load import SETTLE_S, STEP_S, TOPIC, Load, due_of, read_load
from metaros.idl import schema_text, type_hash
from metaros.link import SampleColumns

__all__ = ["main"]

ROBOT = "inside"
TYPE = "std_msgs/msg/UInt8MultiArray"


class _Kept(Gateway):
    """A gateway that the benchmark can publish into."""

    made: Gateway

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        _Kept.made = self


async def _gateway(options: argparse.Namespace) -> None:
    setattr(gateway_main, "Gateway", _Kept)  # noqa: B010 - the type checker would mind, and rightly
    stop, up = asyncio.Event(), asyncio.get_running_loop().create_future()
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(
            port=0,
            grpc_port=0,
            api_grpc_port=0,
            data_dir=Path(folder) / "data",
            foxglove_port=-1,
            rosbridge_port=-1,
            anonymous_requests_per_s=0.0,
            tick_s=options.tick_ms / 1000,
            viewer_stall_s=options.stall_s,
        )
        task = asyncio.create_task(serve(settings, stop, on_ready=up.set_result))
        await asyncio.wait({task, up}, return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()  # tells why
        ready: Ready = up.result()
        tune_garbage_collector()  # as `metaros gateway` does
        _Kept.made.registry.add(RobotRecord(Robot(id=ROBOT), seen_ns=1))
        print(ready.http_port, ready.grpc_port, flush=True)
        while (load := await asyncio.to_thread(read_load)) is not None:
            sent = await _Generator(load).done
            await asyncio.sleep(SETTLE_S)
            print(sent, flush=True)
        stop.set()
        await task


class _Generator:
    """Publishes a load into the hub, from a timer of the loop; `done` gives how many messages it were."""

    def __init__(self, load: Load) -> None:
        self._loop = asyncio.get_running_loop()
        self.done: asyncio.Future[int] = self._loop.create_future()
        self._due: Iterator[int] = due_of(load)
        self._size, self._sent = load.size, 0
        self._made: dict[int, tuple[Any, Any, Any]] = {}  # by count; the hub copies what somebody wants
        self._hub, self._channel = _Kept.made.hub, _channel()
        self._step()

    def _step(self) -> None:
        due = next(self._due, None)
        if due is None:
            self.done.set_result(self._sent)
            return
        self._loop.call_later(STEP_S, self._step)
        if due:
            stamp_ns = time.time_ns()
            payload, offsets, stamps_ns = self._stamped(due, stamp_ns)
            columns = SampleColumns(
                stream_id=1,
                epoch=1,
                first_seq=self._sent + 1,
                stamps_ns=stamps_ns,
                offsets=offsets,
                payload=payload,
            )
            self._sent += due
            self._hub.publish(Run(self._channel, columns, stamp_ns))

    def _stamped(self, due: int, stamp_ns: int) -> tuple[Any, Any, Any]:
        """So many messages with the stamp of now, where each begins, and their stamps on the link."""
        size = self._size
        if due not in self._made:
            self._made[due] = bytearray(due * size), np.arange(due + 1) * size, np.zeros(due, np.int64)
        buffer, offsets, stamps_ns = self._made[due]
        stamps_ns.fill(stamp_ns)
        stamp = time.monotonic_ns().to_bytes(8, "little")
        for start in range(0, due * size, size):
            buffer[start : start + 8] = stamp
        return buffer, offsets, stamps_ns


def _channel() -> Channel:
    return Channel(
        robot=ROBOT,
        channel_id=1,
        topic=TOPIC,
        schema_name=TYPE,
        schema_encoding="ros2msg",
        schema=schema_text(TYPE).encode(),
        type_hash=type_hash(TYPE),
    )


def main(argv: list[str]) -> int:
    """Be the gateway."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tick-ms", type=float, default=5.0, help="of the fan-out")
    parser.add_argument("--stall-s", type=float, default=10.0, help="after which it cuts who takes nothing")
    parser.add_argument("--core", type=int, help="the one CPU that it runs on")
    options = parser.parse_args(argv)
    if options.core is not None:
        os.sched_setaffinity(0, {options.core})
    with asyncio.Runner(loop_factory=new_event_loop) as runner:
        runner.run(_gateway(options))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
