"""Replaying a real robot through a real Zenoh router: complete, in order and equal to the file."""

from __future__ import annotations

import threading
import time
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import metaros
from metaros.errors import ConfigError, NameError_
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import LaserScan
from metaros.interfaces.tf2_msgs.msg import TFMessage
from metaros.record import PlayReport, play_carmen
from metaros.record.carmen import LaserLine, LogCount, OdometryLine, Record, in_ipc_order, open_log, read_log
from tests.support.data import data_set
from tests.support.waiting import wait_until

Contexts = tuple[metaros.Context, metaros.Context]


class Listener:
    """Keeps every message of the three topics, on a thread of its own."""

    def __init__(self, context: metaros.Context, name: str) -> None:
        self.node = metaros.Node("listener", context=context)
        self.scans: list[LaserScan] = []
        self.odometry: list[Odometry] = []
        self.tf: list[TFMessage] = []
        self.source_stamps: list[int] = []
        self.node.create_subscription(LaserScan, f"/{name}/scan", self.on_scan, metaros.qos_reliable_all)
        self.node.create_subscription(Odometry, f"/{name}/odom", self.odometry.append, metaros.qos_reliable_all)
        self.node.create_subscription(TFMessage, f"/{name}/tf", self.tf.append, metaros.qos_reliable_all)
        self.executor = metaros.SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self.executor.spin)
        self.thread.start()

    def on_scan(self, message: LaserScan, info: metaros.MessageInfo) -> None:
        self.scans.append(message)
        self.source_stamps.append(info.source_stamp_ns)

    def close(self) -> None:
        self.executor.shutdown()
        self.thread.join(60)
        self.node.close()


def first_seconds(path: Path, seconds: float) -> list[Record]:
    count = LogCount()
    with open_log(path) as source:
        ordered = in_ipc_order(read_log(source, count), count)
        first = next(ordered)
        return [first, *takewhile(lambda record: record.stamp_s - first.stamp_s <= seconds, ordered)]


def stamp_s(message: Any) -> float:
    return float(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)


def test_some_seconds_of_intel_at_full_speed_are_complete(contexts: Contexts) -> None:
    path = data_set("robots/intel.clf.bz2")
    expected = first_seconds(path, 15.0)
    scans = [record for record in expected if isinstance(record, LaserLine)]
    odometry = [record for record in expected if isinstance(record, OdometryLine)]
    listener = Listener(contexts[1], "intel")
    reports: list[PlayReport] = []
    try:
        begin_ns = contexts[0].clock.wall_ns()
        report = play_carmen(path, name="intel", context=contexts[0], rate=0, limit_s=15, on_progress=reports.append)
        wait_until(lambda: len(listener.scans) >= len(scans) and len(listener.tf) >= len(odometry))
    finally:
        listener.close()
    assert (report.scans, report.odometry, report.malformed) == (len(scans), len(odometry), 0)
    assert reports[-1] == report
    assert len(listener.scans) == len(scans) > 70
    assert len(listener.odometry) == len(listener.tf) == len(odometry) > 130
    for message, line in zip(listener.scans, scans, strict=True):
        np.testing.assert_array_equal(message.ranges, line.ranges_m)
        assert stamp_s(message) == pytest.approx(line.stamp_s, abs=2e-6)
    for odom, record in zip(listener.odometry, odometry, strict=True):
        assert (odom.pose.pose.position.x, odom.pose.pose.position.y) == record.pose[:2]
    assert min(listener.source_stamps) > begin_ns


LINES = "".join(f"ODOM {n}.0 0.0 0.0 0.1 0.0 0.0 {100 + n * 0.1:.2f} h {n * 0.1:.1f}\n" for n in range(6))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "short.clf"
    path.write_text(LINES + "garbage \x01\n")
    return path


def test_the_logs_own_pace(log: Path, contexts: Contexts) -> None:
    begin = time.monotonic()
    report = play_carmen(log, name="r", context=contexts[0], rate=2.5, wait_subscriber_s=0.0)
    lasted = time.monotonic() - begin
    assert (report.odometry, report.skipped) == (6, 1)
    assert report.log_s == pytest.approx(0.5)
    assert lasted >= 0.2


def test_looping_until_stopped(log: Path, contexts: Contexts) -> None:
    stop = threading.Event()
    reports: list[PlayReport] = []

    def watch(report: PlayReport) -> None:
        reports.append(report)
        if report.odometry > 12:
            stop.set()

    options = {"rate": 10.0, "loop": True, "wait_subscriber_s": 0.0, "on_progress": watch, "stop": stop}
    report = play_carmen(log, name="r", context=contexts[0], **options)
    assert report.odometry > 12
    assert report.log_s > 1.0


def test_stopping_before_the_start(log: Path, contexts: Contexts) -> None:
    stop = threading.Event()
    stop.set()
    assert play_carmen(log, name="r", context=contexts[0], stop=stop).odometry == 0


def test_what_cannot_be_played(log: Path, tmp_path: Path, contexts: Contexts) -> None:
    (tmp_path / "empty.clf").write_text("# nothing\n")
    context = contexts[0]
    with pytest.raises(ConfigError, match="no such log"):
        play_carmen(tmp_path / "none.clf", name="r", context=context)
    with pytest.raises(ConfigError, match="rate"):
        play_carmen(log, name="r", context=context, rate=-1.0)
    with pytest.raises(NameError_):
        play_carmen(log, name="a b", context=context)
    with pytest.raises(ConfigError, match="CARMEN"):
        play_carmen(tmp_path / "empty.clf", name="r", context=context, wait_subscriber_s=0.0)
