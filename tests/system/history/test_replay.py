"""A real robot's log through agent and gateway: everything counted, nothing lost, the ranges those of the file."""

from __future__ import annotations

import bz2
import json
from pathlib import Path

import numpy as np

from metaros.cdr import codec
from tests.support.data import data_set
from tests.support.gateways.viewer import open_socket, records, subscribe
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

SPAN_S = 120.0  # of the log


def read_log(path: Path) -> tuple[list[tuple[float, list[float]]], list[float], float]:
    """Scans by ipc time, the times of odometry lines, and the first ipc time: an independent reading of the file."""
    scans, odometry, start = [], [], float("inf")
    for line in bz2.decompress(path.read_bytes()).decode().splitlines():
        words = line.split()
        if words and words[0] == "FLASER":
            count = int(words[1])
            scans.append((float(words[-3]), [float(word) for word in words[2 : 2 + count]]))
        elif words and words[0] == "ODOM":
            odometry.append(float(words[-3]))
    start = min(min(odometry), min(stamp for stamp, _ in scans))
    return sorted(scans, key=lambda scan: scan[0]), odometry, start


def replay(stack: Stack, *, limit_s: float, scans: int) -> tuple[dict[str, dict], list[bytes]]:
    """Play the Intel log through the real programs; the gateway's topic table and the scans a viewer received."""
    path = data_set("robots/intel.clf.bz2")
    received: list[bytes] = []
    stack.router_program()
    stack.agent("intel")
    wait_until(lambda: "intel" in stack.online(), timeout_s=60)
    with open_socket(stack.url, "/api/v1/stream") as viewer:
        subscribe(viewer, 1, "intel", "/intel/scan", mode="queue", queue_bytes=8 << 20)
        options = ("--rate", "0", "--zenoh-port", str(stack.zenoh_port), "--limit", f"{limit_s:g}")
        play = stack.start("play", "play", str(path), "--name", "intel", *options, ready=False)
        while play.process.poll() is None or drained(stack, scans) is False:
            try:
                frame = viewer.recv(timeout=0.2)
            except TimeoutError:
                continue
            if isinstance(frame, bytes):
                received += [record.payload for record in records(frame)]
            else:
                assert json.loads(frame)["op"] != "dropped", frame
        assert play.process.returncode == 0, play.output
        topics = stack.topics("intel")
        wait_until(lambda: len(received) >= topics["/intel/scan"]["received"] or pump(viewer, received), timeout_s=60)
    return topics, received


def pump(viewer: object, received: list[bytes]) -> bool:
    """Take one more frame if there is one."""
    try:
        frame = viewer.recv(timeout=0.2)  # type: ignore[attr-defined]
    except TimeoutError:
        return False
    if isinstance(frame, bytes):
        received += [record.payload for record in records(frame)]
    return False


def drained(stack: Stack, scans: int) -> bool:
    """Whether the agent has seen everything, and all of it has arrived at the gateway."""
    topics = stack.topics("intel")
    robot = stack.get("/api/v1/robots/intel")
    scan = topics.get("/intel/scan")
    return bool(scan and robot["link"]["outbox_samples"] == 0 and scan["messages"] == scan["received"] >= scans)


def check(topics: dict[str, dict], received: list[bytes], scans: list[list[float]], odometry: int) -> None:
    """Counts, losses and every range of every scan."""
    assert topics["/intel/scan"]["received"] == len(scans)
    assert topics["/intel/odom"]["received"] == odometry
    assert [topics[name]["lost"] for name in ("/intel/scan", "/intel/odom", "/intel/tf")] == [0, 0, 0]
    assert [topics[name]["dropped"] for name in ("/intel/scan", "/intel/odom", "/intel/tf")] == [0, 0, 0]
    assert topics["/intel/scan"]["class"] == "bulk"
    decode = codec("sensor_msgs/msg/LaserScan").decode
    assert len(received) == len(scans)
    for payload, ranges in zip(received, scans, strict=True):
        np.testing.assert_array_equal(decode(payload).ranges, np.asarray(ranges, np.float32))


def test_the_first_minutes_of_intel_as_fast_as_they_go(shared_gateway: Stack, tmp_path: Path) -> None:
    scans, odometry, start = read_log(data_set("robots/intel.clf.bz2"))
    assert (len(scans), len(odometry)) == (13_631, 26_915)
    expected = [ranges for stamp, ranges in scans if stamp - start <= SPAN_S]
    assert len(expected) > 500
    with shared_gateway.beside(tmp_path) as stack:
        topics, received = replay(stack, limit_s=SPAN_S, scans=len(expected))
    check(topics, received, expected, sum(stamp - start <= SPAN_S for stamp in odometry))
