"""Resident memory of a publisher and a subscriber over an hour of 1 kHz, sent as fast as it goes.

    python -m load_tests memory [--messages 3600000] [--images 100000]

Two processes, linked directly. Each looks at its own resident size some twenty times; the first quarter is warm-up,
over the rest a straight line is laid. Flat is a slope of about nothing. `typed` are messages of an annotated class,
keep-all so that every one arrives; `images` go through shared memory, and a subscriber that is late keeps the last ten.
"""

from __future__ import annotations

import argparse
import json
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any

import psutil

import metaros
from load_tests.figures import note
from metaros.interfaces.sensor_msgs.msg import Image
from metaros.wire import Congestion, QoSProfile, qos_reliable_all

__all__ = ["main", "run"]

_LOOKS = 20
_WARM_UP = 4  # one part in so many
_IMAGE_BYTES = 256 << 10
_TOPIC = "/bench_memory"
_LAST_S = 30.0  # for what was sent and has not come, at most


def message_of(kind: str) -> Any:
    """What is published. The type is made in the two processes only: its maker has it in its catalogue."""
    if kind == "typed":

        @metaros.message(name="bench_interfaces/msg/Reading")
        class Reading:
            """What a sensor says a thousand times a second."""

            stamp_ns: int = 0
            frame_id: str = ""
            values: list[float] = field(default_factory=list)

        return Reading(stamp_ns=1, frame_id="base_link", values=[0.5] * 8)
    return Image(height=512, width=512, step=512, encoding="mono8", data=bytes(_IMAGE_BYTES))


class Looks:
    """`one` counts messages; the resident size is looked at in equal distances."""

    def __init__(self, total: int) -> None:
        self.count, self.sizes = 0, list[int]()
        self._every = max(1, total // _LOOKS)
        self._look: Callable[[], Any] = psutil.Process().memory_info

    def one(self, _message: Any = None) -> None:
        """One more message."""
        self.count += 1
        if self.count % self._every == 0:
            self.sizes.append(self._look().rss)


def _end(role: str, kind: str, endpoint: str, total: int) -> None:
    """One of the two processes."""
    where: dict[str, Any] = (
        {"connect": [], "listen": endpoint} if role == "sub" else {"connect": endpoint, "listen": []}
    )
    looks = Looks(total)
    mode = "auto" if kind == "images" else "off"
    qos = QoSProfile(congestion=Congestion.BLOCK) if kind == "images" else qos_reliable_all
    with (
        metaros.Context(domain_id=0, shared_memory=mode, **where) as context,
        metaros.Node(f"bench_{role}", context=context) as node,
    ):
        message, pause = message_of(kind), threading.Event()
        if role == "sub":
            node.create_subscription(type(message), _TOPIC, looks.one, qos)
            threading.Thread(target=metaros.spin, args=(node,), daemon=True).start()
            print("ready", flush=True)
            sys.stdin.readline()
            until_s = time.monotonic() + _LAST_S
            while looks.count < total and time.monotonic() < until_s:  # what was sent may be on its way
                pause.wait(0.01)
        else:
            publisher = node.create_publisher(type(message), _TOPIC, qos)
            while not publisher.events.matched:
                pause.wait(0.01)
            for _ in range(total):
                publisher.publish(message)
                looks.one()
        print(json.dumps(looks.sizes), flush=True)


def run(kind: str, total: int) -> dict[str, list[int]]:
    """The resident sizes of both processes."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{listener.getsockname()[1]}"
    command = [sys.executable, "-m", "load_tests.benchmarks.library.memory", "--kind", kind, "--endpoint", endpoint]
    command += ["--messages", str(total), "--role"]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([*command, "sub"], **pipes) as sub, subprocess.Popen([*command, "pub"], **pipes) as pub:
        try:
            assert sub.stdout is not None
            sub.stdout.readline()
            sent = json.loads(pub.communicate()[0])
            return {"publisher": sent, "subscriber": json.loads(sub.communicate("\n")[0])}
        finally:
            pub.kill()
            sub.kill()


def slope(sizes: Sequence[int], total: int) -> float:
    """Bytes that each message leaves behind, after the warm-up."""
    kept = sizes[len(sizes) // _WARM_UP :]
    messages = [index * total / len(sizes) for index in range(len(kept))]
    return statistics.linear_regression(messages, kept).slope


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--messages", type=int, default=3_600_000, help="typed messages: an hour of 1 kHz")
    parser.add_argument("--images", type=int, default=100_000, help="images through shared memory")
    for option in ("--role", "--kind", "--endpoint"):
        parser.add_argument(option, help=argparse.SUPPRESS)
    options = parser.parse_args(list(argv))
    if options.role:
        _end(options.role, options.kind, options.endpoint, options.messages)
        return 0
    print(f"{'kind':<8}{'process':<12}{'messages':>10}{'warm MB':>9}{'end MB':>9}{'most MB':>9}{'bytes/message':>15}")
    for kind, total in (("typed", options.messages), ("images", options.images)):
        for process, sizes in run(kind, total).items():
            if (kind, process) == ("typed", "subscriber"):
                note("growth, typed, subscriber", [slope(sizes, total)])
            kept = sizes[len(sizes) // _WARM_UP :]
            megabytes = "".join(f"{size / 1e6:>9.1f}" for size in (kept[0], kept[-1], max(sizes)))
            print(f"{kind:<8}{process:<12}{total:>10,}{megabytes}{slope(sizes, total):>15.3f}", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
