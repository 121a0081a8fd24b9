"""A real robot's log through agent and gateway: everything counted, nothing lost, the ranges those of the file."""

from __future__ import annotations

import bz2
import json
from pathlib import Path

import numpy as np
import pytest

from metaros.cdr import codec
from tests.support.data import data_set
from tests.support.stack import Stack
from tests.support.viewer import open_socket, records, subscribe
from tests.support.waiting import wait_until


def read_log(path: Path) -> tuple[list[tuple[float, list[float]]], int, float]:
    """Scans by ipc time, the number of odometry lines, and the first ipc time: an independent reading of the file."""
    scans, odometry, start = [], [], float("inf")
    for line in bz2.decompress(path.read_bytes()).decode().splitlines():
        words = line.split()
        if words and words[0] == "FLASER":
            count = int(words[1])
            scans.append((float(words[-3]), [float(word) for word in words[2 : 2 + count]]))
        elif words and words[0] == "ODOM":
            odometry.append(float(words[-3]))
    start = min(min(odometry), min(stamp for stamp, _ in scans))
    return sorted(scans, key=lambda scan: scan[0]), len(odometry), start


def replay(
    folder: Path, *, rate: float, limit_s: float | None, timeout_s: float
) -> tuple[dict[str, dict], list[bytes]]:
    """Play the Intel log through the real programs; the gateway's topic table and the scans a viewer received."""
    path = data_set("robots/intel.clf.bz2")
    received: list[bytes] = []
    with Stack(folder) as stack:
        stack.router()
        stack.gateway()
        stack.agent("intel")
        wait_until(lambda: stack.online() == {"intel"}, timeout_s=60)
        with open_socket(stack.url, "/api/v1/stream") as viewer:
            subscribe(viewer, 1, "intel", "/intel/scan", mode="queue", queue_bytes=8 << 20)
            options = ["--rate", str(rate), "--zenoh-port", str(stack.zenoh_port)]
            options += ["--limit", str(limit_s)] if limit_s else []
            play = stack.start("play", "play", str(path), "--name", "intel", *options, ready=False)
            while play.process.poll() is None or drained(stack) is False:
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
            wait_until(
                lambda: len(received) >= topics["/intel/scan"]["received"] or pump(viewer, received),
                timeout_s=timeout_s,
            )
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


def drained(stack: Stack) -> bool:
    """Whether everything the agent saw has arrived at the gateway."""
    topics = stack.topics("intel")
    robot = stack.get("/api/v1/robots/intel")
    scan = topics.get("/intel/scan")
    return bool(scan and robot["link"]["outbox_samples"] == 0 and scan["messages"] == scan["received"])


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


def test_first_minute_of_intel(tmp_path: Path) -> None:
    scans, _odometry, start = read_log(data_set("robots/intel.clf.bz2"))
    topics, received = replay(tmp_path, rate=0, limit_s=60, timeout_s=30)
    expected = [ranges for stamp, ranges in scans if stamp - start <= 60]
    check(topics, received, expected, topics["/intel/odom"]["messages"])
    assert topics["/intel/odom"]["messages"] > 500


@pytest.mark.integration
@pytest.mark.timeout(600)
def test_all_of_intel_at_twenty_times(tmp_path: Path) -> None:
    scans, odometry, _start = read_log(data_set("robots/intel.clf.bz2"))
    assert (len(scans), odometry) == (13_631, 26_915)
    topics, received = replay(tmp_path, rate=20, limit_s=None, timeout_s=60)
    check(topics, received, [ranges for _stamp, ranges in scans], odometry)
