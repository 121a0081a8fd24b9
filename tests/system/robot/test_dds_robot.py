"""A robot on Cyclone DDS in the fleet, by a bridge beside it: listed, forwarded to a viewer, driven under a lease."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from metaros.cdr import codec
from metaros.interfaces.sensor_msgs.msg import LaserScan
from tests.metaros.dds import dds_types as dds
from tests.support.gateways.viewer import open_socket, records, subscribe
from tests.support.processes.stack import Stack
from tests.support.servers.dds import dds_config, dds_domain
from tests.support.waiting import wait_until

RELIABLE = Qos(Policy.Reliability.Reliable(100_000_000), Policy.History.KeepLast(10))


class DdsRobot:
    """It says hello and scans ten times a second, and notes the speeds that it is told."""

    def __init__(self) -> None:
        self._domain, self._participant = Domain(dds_domain(), dds_config()), DomainParticipant(dds_domain())
        self._hello = self._end(DataWriter, "rt/chatter", dds.String)
        self._scan = self._end(DataWriter, "rt/scan", dds.LaserScan)
        self._told = self._end(DataReader, "rt/cmd_vel", dds.Twist)
        self.speeds: list[float] = []

    def _end(self, kind: Any, topic: str, message: type[Any]) -> Any:
        return kind(self._participant, Topic(self._participant, topic, message), qos=RELIABLE)

    def step(self) -> None:
        header = dds.Header(dds.Time(1, 2), "laser")
        self._hello.write(dds.String("hello"))
        self._scan.write(dds.LaserScan(header, 0.0, 1.0, 0.5, 0.0, 0.1, 0.1, 30.0, [1.0, 2.0, 3.0], []))
        self.speeds += [twist.linear.x for twist in self._told.take(50)]


@contextmanager
def running(robot: DdsRobot) -> Iterator[None]:
    """The robot at work."""
    ended = threading.Event()

    def work() -> None:
        while not ended.wait(0.1):
            robot.step()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(60)


@pytest.mark.integration
def test_a_robot_on_dds_is_in_the_fleet(shared_gateway: Stack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", dds_config())
    robot = DdsRobot()
    with shared_gateway.beside(tmp_path) as stack, running(robot):
        stack.router()
        stack.start("dds", "dds", "--dds-domain", str(dds_domain()), "--zenoh-port", str(stack.zenoh_port))
        stack.agent("on_dds", namespace="/")
        wait_until(lambda: {"/chatter", "/scan"} <= stack.topics("on_dds").keys())
        assert stack.topics("on_dds")["/scan"]["type"] == "sensor_msgs/msg/LaserScan"
        with open_socket(stack.url, "/api/v1/stream") as viewer:
            subscribe(viewer, 1, "on_dds", "/scan")
            frames = (viewer.recv(timeout=60) for _ in range(1000))
            payload = next(next(records(frame)).payload for frame in frames if isinstance(frame, bytes))
        assert codec(LaserScan).decode(payload).ranges.tolist() == [1.0, 2.0, 3.0]
        with open_socket(stack.url, "/api/v1/robots/on_dds/teleop", key=stack.key) as driver:
            driver.send(json.dumps({"op": "take", "holder": "test"}))
            assert json.loads(driver.recv(timeout=60))["op"] == "granted"
            for seq in range(1, 200):
                driver.send(json.dumps({"op": "drive", "linear": 0.4, "angular": 0.0, "seq": seq}))
                if 0.4 in robot.speeds:
                    break
                threading.Event().wait(0.1)
        wait_until(lambda: robot.speeds[-1:] == [0.0])  # who drove has gone: the agent brings it to rest
        assert 0.4 in robot.speeds
