"""Simulated robots on a real Zenoh router: topics and rates, who drives, faults, log lines, a clean end."""

from __future__ import annotations

import json
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import metaros
from metaros.clock import Clock, ManualClock
from metaros.errors import ConfigError
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.rcl_interfaces.msg import Log
from metaros.interfaces.sensor_msgs.msg import CompressedImage
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.sim import run_sim
from metaros.sim.node import TOPICS
from tests.support.processes.fast_loop import HurriedClock
from tests.support.waiting import wait_until


class Observer:
    """A node on a thread of its own that keeps what it hears."""

    def __init__(self, context: metaros.Context) -> None:
        self.context = context
        self.node = metaros.Node("observer", context=self.context)
        self.executor = metaros.SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.counts: Counter[str] = Counter()
        self.heard: dict[str, Any] = {}
        self.log: list[str] = []
        self.speeds: list[float] = []
        self.thread = threading.Thread(target=self.executor.spin)

    def listen(self, kind: type[Any], topic: str) -> None:
        def keep(message: Any) -> None:
            self.counts[topic] += 1
            self.heard[topic] = message
            if isinstance(message, Odometry):
                self.speeds.append(abs(message.twist.twist.linear.x))
            if isinstance(message, Log):
                self.log.append(f"{message.name}: {message.msg}")

        self.node.create_subscription(kind, topic, keep, 10)

    def speed(self) -> float:
        return self.speeds[-1] if self.speeds else 0.0

    def close(self) -> None:
        self.executor.shutdown()
        self.thread.join(60)
        self.node.close()
        self.context.close()


Start = Callable[..., Observer]


@pytest.fixture
def simulate(zenoh_router: str, tmp_path: Path) -> Iterator[Start]:
    """Start `run_sim` on a thread with an observer beside it; everything ends with the test.

    Without a clock of its own it is hurried; with one it shares the observer's context, where nothing is missed.
    """
    stop, running = threading.Event(), []

    def start(listen: list[tuple[type[Any], str]], *, clock: Clock | None = None, **options: Any) -> Observer:
        context = metaros.Context(connect=zenoh_router, clock=clock or HurriedClock(speed=5.0))
        observer = Observer(context if clock else metaros.Context(connect=zenoh_router))
        for kind, topic in listen:
            observer.listen(kind, topic)
        observer.thread.start()
        status = tmp_path / "status.json"
        options = {"context": context, "stop": stop, "status_file": status, **options}
        thread = threading.Thread(target=run_sim, kwargs=options)
        thread.start()
        running.append((observer, context, thread))
        wait_until(status.exists)
        names = [f"sim_{number + 1}" for number in range(options["robots"])]
        assert json.loads(status.read_text())["robots"] == names
        return observer

    yield start
    stop.set()
    for observer, context, thread in running:
        thread.join(60)
        assert not thread.is_alive()
        context.close()
        observer.close()


def test_every_topic_comes_at_its_rate(simulate: Start) -> None:
    pytest.importorskip("cv2")
    topics = [(topic.type, f"/sim_{number}/{topic.topic}") for number in (1, 2) for topic in TOPICS]
    clock = ManualClock()
    observer = simulate(topics, robots=2, seed=1, clock=clock)
    counts = observer.counts
    wait_until(lambda: counts["/sim_1/imu"] == counts["/sim_2/imu"] == 1)  # the first step is due at once
    for tenth in range(20):
        clock.advance(0.1)
        wait_until(lambda steps=5 * tenth + 6: counts["/sim_1/imu"] == counts["/sim_2/imu"] == steps)
    for number in (1, 2):
        for topic in TOPICS:
            name = f"/sim_{number}/{topic.topic}"
            wait_until(lambda name=name, rate_hz=topic.rate_hz: abs(counts[name] - 2 * rate_hz) <= 1)
    picture = observer.heard["/sim_2/camera/image/compressed"]
    assert bytes(picture.data[:2]) == b"\xff\xd8"
    assert picture.header.frame_id == "sim_2/camera"


def test_cmd_vel_takes_over_and_stops_when_it_ends(simulate: Start) -> None:
    observer = simulate([(Odometry, "/sim_1/odom"), (Log, "/rosout")], robots=1, seed=1, resume_after_s=60.0)
    drive = observer.node.create_publisher(Twist, "/sim_1/cmd_vel", 10)
    twist = Twist()

    def push() -> bool:
        drive.publish(twist)
        return len(observer.speeds) > 2

    wait_until(lambda: push() and observer.speed() == 0.0, every_s=0.01)
    twist.linear.x = -0.3
    wait_until(lambda: push() and observer.speed() > 0.2, every_s=0.01)
    wait_until(lambda: observer.speed() == 0.0, timeout_s=60)
    wait_until(lambda: any("watchdog" in line for line in observer.log))
    assert any("taken over" in line for line in observer.log)

    resume = observer.node.create_client(Trigger, "/sim_1/base/resume")
    assert resume.wait_for_service(60)
    assert resume.call(Trigger.Request(), timeout_s=60).success
    wait_until(lambda: observer.speed() > 0.1 or abs(observer.heard["/sim_1/odom"].twist.twist.angular.z) > 0.1)


def test_faults_by_topic_and_schedule(simulate: Start) -> None:
    pytest.importorskip("cv2")
    image = "/sim_1/camera/image/compressed"
    observer = simulate(
        [(Log, "/rosout"), (CompressedImage, image)], robots=1, seed=1, faults=["sim_1:camera_freeze@0.5"]
    )
    wait_until(lambda: any("camera_freeze" in line for line in observer.log))
    wait_until(lambda: observer.counts[image] > 0)
    first = observer.heard[image]
    seen = observer.counts[image]
    wait_until(lambda: observer.counts[image] >= seen + 5)
    later = observer.heard[image]
    assert bytes(later.data) == bytes(first.data)
    assert later.header.stamp != first.header.stamp
    fault = observer.node.create_publisher(String, "/sim_1/base/fault", 10)

    def clear() -> bool:
        fault.publish(String(data="clear"))
        return any("cleared: camera_freeze" in line for line in observer.log)

    wait_until(clear, every_s=0.02)
    wait_until(lambda: bytes(observer.heard[image].data) != bytes(first.data))


def test_without_a_camera_the_topic_is_not_offered(simulate: Start) -> None:
    observer = simulate([(Odometry, "/sim_1/odom")], robots=1, seed=1, camera=False)
    wait_until(lambda: observer.counts["/sim_1/odom"] > 3)
    wait_until(lambda: "/sim_1/scan" in observer.node.graph.topics())
    assert "/sim_1/camera/image/compressed" not in observer.node.graph.topics()


def test_bad_settings_are_refused_before_anything_starts(zenoh_router: str) -> None:
    bad = [{"faults": ["nonsense"]}, {"faults": ["sim_9:clear"]}, {"robots": 0}, {"first": -1}, {"resume_after_s": -1}]
    with metaros.Context(connect=zenoh_router) as context:
        for options in bad:
            with pytest.raises(ConfigError):
                run_sim(context=context, **options)
        assert context.graph.nodes() == []
