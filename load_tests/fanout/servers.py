"""What the benchmark measures, each in a process of its own: a real gateway, and the server of PyPI's foxglove-sdk.

    python -m load_tests.fanout.servers gateway|foxglove [--tick-ms 5] [--stall-s 10]

Prints its port; then each line of its input, JSON of a `Load`, makes it publish that, and it prints what CPU time that
took and how many messages it were. Both publish inside the server's own process, what is due each millisecond: what is
measured is the way from there to the viewers.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import struct
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gateway import main as gateway_main
from gateway.app import Gateway
from gateway.domain.channel import Channel
from gateway.domain.robot import Robot
from gateway.domain.sample import Run
from gateway.heap import settle_heap
from gateway.ingest.registry import RobotRecord
from gateway.main import Ready, new_event_loop, serve
from gateway.settings import Settings
from metaros.idl import schema_text, type_hash
from metaros.link import SampleColumns

__all__ = ["Load", "main"]

TOPICS = {False: "/bench", True: "/text"}
STEP_S = 0.001
SETTLE_S = 0.3
TYPE = "std_msgs/msg/UInt8MultiArray"
_STAMP = struct.Struct("<Q")


@dataclass(frozen=True)
class Load:
    """What is published: messages of `size` bytes, so many a second; `text`: std_msgs/String, for JSON."""

    seconds: float
    rate: float
    size: int
    text: bool = False


def _payload(size: int, filler: bytes) -> bytes:
    return _STAMP.pack(time.monotonic_ns()) + filler[: size - 8]


def _due(load: Load) -> Iterator[int]:
    """How many messages are due, each time it is asked."""
    began_s, sent = time.monotonic(), 0
    while (passed_s := time.monotonic() - began_s) < load.seconds:
        due = int(passed_s * load.rate) + 1 - sent
        sent += due
        yield due


def _read_load() -> Load | None:
    line = sys.stdin.readline()
    return Load(**json.loads(line)) if line else None


def _text_payload(size: int, filler: bytes) -> bytes:
    """A std_msgs/String in CDR whose text begins with the stamp's digits."""
    text = b"@%020d" % time.monotonic_ns() + filler[: size - 21] + b"\0"
    return b"\0\1\0\0" + len(text).to_bytes(4, "little") + text


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
        settle_heap()  # as `metaros gateway` does
        _Kept.made.registry.add(RobotRecord(Robot(id="bench"), seen_ns=1))
        print(ready.http_port, flush=True)
        while (load := await asyncio.to_thread(_read_load)) is not None:
            await _publish(load)
        stop.set()
        await task


def _channel(*, text: bool) -> Channel:
    kind = "std_msgs/msg/String" if text else TYPE
    return Channel(
        robot="bench",
        channel_id=1 + text,
        topic=TOPICS[text],
        schema_name=kind,
        schema_encoding="ros2msg",
        schema=schema_text(kind).encode(),
        type_hash=type_hash(kind),
    )


async def _publish(load: Load) -> None:
    make, filler, hub = (_text_payload if load.text else _payload), b"x" * load.size, _Kept.made.hub
    channel, seq, began_s = _channel(text=load.text), 0, time.process_time()
    for due in _due(load):
        if due:
            payloads, stamp_ns = [make(load.size, filler) for _ in range(due)], time.time_ns()
            columns = SampleColumns(
                stream_id=1,
                epoch=1,
                first_seq=seq + 1,
                stamps_ns=np.full(due, stamp_ns),
                offsets=np.arange(due + 1) * len(payloads[0]),
                payload=b"".join(payloads),
            )
            hub.publish(Run(channel, columns, stamp_ns))
            seq += due
        await asyncio.sleep(STEP_S)
    await asyncio.sleep(SETTLE_S)
    print(f"{time.process_time() - began_s:.6f} {seq}", flush=True)


def _foxglove() -> None:
    import foxglove

    server = foxglove.start_server(name="bench", port=0)
    schema = foxglove.Schema(name=TYPE, encoding="ros2msg", data=schema_text(TYPE).encode())
    channel = foxglove.Channel(TOPICS[False], schema=schema, message_encoding="cdr")
    print(server.port, flush=True)
    while (load := _read_load()) is not None:
        filler, sent, began_s = b"x" * load.size, 0, time.process_time()
        for due in _due(load):
            for _ in range(due):
                channel.log(_payload(load.size, filler), log_time=time.time_ns())
            sent += due
            time.sleep(STEP_S)
        time.sleep(SETTLE_S)
        print(f"{time.process_time() - began_s:.6f} {sent}", flush=True)
    server.stop()


def main(argv: list[str]) -> int:
    """Be one of the servers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server", choices=("gateway", "foxglove"))
    parser.add_argument("--tick-ms", type=float, default=5.0, help="of the gateway's fan-out")
    parser.add_argument("--stall-s", type=float, default=10.0, help="after which the gateway cuts who takes nothing")
    parser.add_argument("--core", type=int, help="the one CPU that it runs on")
    options = parser.parse_args(argv)
    if options.core is not None:
        os.sched_setaffinity(0, {options.core})
    if options.server == "foxglove":
        _foxglove()
        return 0
    with asyncio.Runner(loop_factory=new_event_loop) as runner:
        runner.run(_gateway(options))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
