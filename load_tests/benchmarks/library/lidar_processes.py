"""The processes of the benchmark `lidar`: the lidar (`send`), the driver (`drive`) and a local subscriber (`count`).

Each says a JSON line when it is ready and one at its end; `drive` and `count` end by a line on stdin.
"""

from __future__ import annotations

import argparse
import json
import socket
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any

import metaros
from metaros.drivers.node import DriverNode
from metaros.drivers.registry import device_maker, manifest_of
from metaros.interfaces.sensor_msgs.msg import PointCloud2
from metaros.wire import qos_reliable_all
from tests.support.devices.vlp16_emulator import Vlp16Emulator

__all__ = ["PACKETS_A_S", "POINTS_A_S", "main"]

PACKETS_A_S = 1e6 / 1327.104
POINTS_A_S = PACKETS_A_S * 384
_BEGIN_S = 0.3


def _report(**facts: Any) -> None:
    print(json.dumps(facts), flush=True)


def _send(port: int, seconds: float) -> None:
    """Full rate, by the clock."""
    emulator = Vlp16Emulator()
    packets = [emulator.packet() for _ in range(round(seconds * PACKETS_A_S))]
    _report(ready=True)
    begin_s = time.perf_counter() + _BEGIN_S
    late_s = 0.0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        for number, packet in enumerate(packets):
            due_s = begin_s + number / PACKETS_A_S
            wait_s = due_s - time.perf_counter()
            if wait_s > 0:
                time.sleep(wait_s)
            late_s = max(late_s, -wait_s)
            wire.sendto(packet, ("127.0.0.1", port))
    _report(packets=len(packets), seconds=time.perf_counter() - begin_s, latest_ms=late_s * 1000)


def _drive(endpoint: str) -> None:
    """The driver as the agent runs it, but for its supervisor."""
    with metaros.Context(connect=endpoint) as context:
        node = DriverNode(
            manifest_of("vlp16"),
            device_maker("vlp16"),
            {"port": 0, "delivery": "all"},
            context=context,
            namespace="/bench",
        )
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        threading.Thread(target=executor.spin, daemon=True).start()
        node.start()
        while "udp_port" not in node.standing.facts:
            time.sleep(0.01)
        time.sleep(_BEGIN_S)
        cpu_s = time.process_time()
        _report(port=int(node.standing.facts["udp_port"]))
        sys.stdin.readline()
        cpu_s = time.process_time() - cpu_s
        _report(cpu_s=cpu_s, counters=dict(node.standing.counters), buffer=node.standing.facts["receive_buffer_bytes"])
        node.stop()
        executor.shutdown()


def _count(endpoint: str) -> None:
    """Every cloud, decoded."""
    clouds = points = 0

    def received(cloud: PointCloud2) -> None:
        nonlocal clouds, points
        clouds += 1
        points += cloud.width

    with metaros.Context(listen=endpoint) as context:
        node = metaros.Node("counter", context=context)
        node.create_subscription(PointCloud2, "/bench/points", received, qos_reliable_all, dedicated=True)
        _report(ready=True)
        sys.stdin.readline()
        _report(clouds=clouds, points=points)


def main(argv: Sequence[str] = ()) -> int:
    """Be one of them."""
    parser = argparse.ArgumentParser()
    parser.add_argument("role", choices=("send", "drive", "count"))
    parser.add_argument("--endpoint", default="")
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=1.0)
    options = parser.parse_args(list(argv))
    if options.role == "send":
        _send(options.port, options.seconds)
    elif options.role == "drive":
        _drive(options.endpoint)
    else:
        _count(options.endpoint)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
