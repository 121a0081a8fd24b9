"""The `metaros` 1.1.5 of PyPI, unmodified, in a venv of its own: through the broker it hears nodes, and nodes hear it.

It manages at most 19 messages a second and loses most of a faster stream, because its subscriber opens a new socket
for every message: so what is asserted is that messages arrive, and arrive whole, not how many.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import LaserScan
from metaros.interfaces.std_msgs.msg import Bool, Float64, Header, Int64, String
from tests.metaros.broker.conftest import Rig, make_rig, rig  # noqa: F401
from tests.support.waiting import wait_until

PINNED = ("metaros==1.1.5", "numpy==2.4.6", "pyzmq==27.3.0", "setuptools==84.2.1")

PUBLISHER = """
import sys, time
from metaros import Publisher
from metaros.messages import Bool, Float64, Int64, LaserScan, Odometry, String, Twist, Vector3

messages = {
    "/text": String("from 1.1.5"), "/number": Float64(2.5), "/count": Int64(7), "/flag": Bool(True),
    "/cmd": Twist(Vector3(0.5, 0.0, 0.0), Vector3(0.0, 0.0, -1.0)), "/odometry": Odometry(child_frame_id="base"),
    "/laser": LaserScan(ranges=[1.0, 2.0, 3.0]), "/unknown": Twist(Vector3(1.5, 0.0, 0.0)),
}
publishers = {topic: Publisher(topic, type(message), port=int(sys.argv[1])) for topic, message in messages.items()}
while True:
    for topic, message in messages.items():
        publishers[topic].publish(message)
    time.sleep(0.1)
"""

SUBSCRIBER = """
import json, sys, threading, time
from metaros import Subscriber
from metaros.messages import Header, Image, Int32, LaserScan, Odometry, String, Twist

classes = {
    "/text": String, "/cmd": Twist, "/laser": LaserScan, "/header": Header, "/image": Image, "/int": Int32,
}
if sys.argv[2:]:  # alone: the parts of an Odometry are, by default, the very objects that every Twist has
    classes = {"/odometry": Odometry}

lock = threading.Lock()

def tell(topic):
    def callback(message):
        with lock:
            print(json.dumps([topic, message.to_json()]), flush=True)
    return callback

subscribers = [Subscriber(topic, cls, tell(topic), port=int(sys.argv[1])) for topic, cls in classes.items()]
while True:
    time.sleep(1)
"""


@pytest.fixture(scope="session")
def old_python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of a venv that has `metaros` 1.1.5 and nothing of ours."""
    folder = tmp_path_factory.mktemp("metaros_1x") / "venv"
    uv = Path(sys.executable).with_name("uv.exe" if sys.platform == "win32" else "uv")
    subprocess.run([uv, "venv", "-q", "--python", sys.executable, folder], check=True)
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    subprocess.run([uv, "pip", "install", "-q", "--python", python, *PINNED], check=True)
    where = subprocess.run(
        [python, "-c", "import metaros; print(metaros.__file__)"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(where.stdout.strip()).is_relative_to(folder), "the package of PyPI, not this checkout"
    return python


@contextmanager
def running(python: Path, program: str, endpoint: str, log: Path, *arguments: str) -> Iterator[Callable[[], list[str]]]:
    """An old program that connects to the port of `endpoint`; gives the lines that it has printed."""
    port = endpoint.rpartition(":")[2]
    with log.open("wb") as out:
        command = [str(python), "-c", program, port, *arguments]
        with subprocess.Popen(command, cwd=log.parent, stdout=out, stderr=subprocess.STDOUT) as process:
            try:
                yield lambda: log.read_text().rpartition("\n")[0].splitlines()  # whole ones
                assert process.poll() is None, log.read_text()
            finally:
                process.kill()


@pytest.mark.integration
@pytest.mark.xdist_group("metaros_1x")
@pytest.mark.timeout(300)
def test_its_publisher_is_received_by_a_node(old_python: Path, rig: Rig, tmp_path: Path) -> None:  # noqa: F811
    received: dict[str, Any] = {}
    wanted = {
        "/text": String,
        "/number": Float64,
        "/count": Int64,
        "/flag": Bool,
        "/cmd": Twist,
        "/odometry": Odometry,
        "/laser": LaserScan,
    }
    for topic, cls in wanted.items():
        rig.node.create_subscription(cls, topic, lambda message, topic=topic: received.__setitem__(topic, message))
    with running(old_python, PUBLISHER, rig.hub.xsub[0], tmp_path / "log"):
        wait_until(lambda: received.keys() == wanted.keys(), timeout_s=120)
        wait_until(lambda: "/unknown" in rig.peers.graph.topics())
    assert received["/text"].data == "from 1.1.5"
    assert (received["/number"].data, received["/count"].data, received["/flag"].data) == (2.5, 7, True)
    assert (received["/cmd"].linear.x, received["/cmd"].angular.z) == (0.5, -1.0)
    assert received["/odometry"].child_frame_id == "base"
    assert received["/odometry"].header.stamp.sec > 0
    assert list(received["/laser"].ranges) == [1.0, 2.0, 3.0]
    assert rig.peers.graph.topics()["/unknown"] == {"geometry_msgs/msg/Twist"}, "guessed by its fields"
    assert sum(row.malformed for row in rig.broker.report().rows) == 0


@pytest.mark.integration
@pytest.mark.xdist_group("metaros_1x")
@pytest.mark.timeout(300)
def test_its_subscriber_hears_a_node(old_python: Path, rig: Rig, tmp_path: Path) -> None:  # noqa: F811
    from metaros.interfaces.sensor_msgs.msg import Image
    from metaros.interfaces.std_msgs.msg import Int32

    odometry = Odometry(child_frame_id="base")
    odometry.header.frame_id, odometry.header.stamp.sec = "odom", 12
    odometry.pose.pose.position.x = 1.25
    command = Twist()
    command.linear.x = 0.75
    header = Header(frame_id="map")
    header.stamp.sec, header.stamp.nanosec = 3, 500_000_000
    messages = {
        "/text": String(data="from Meta-ROS"),
        "/cmd": command,
        "/odometry": odometry,
        "/laser": LaserScan(ranges=[1.0, float("inf")], angle_min=-0.5, angle_increment=0.25),
        "/header": header,
        "/image": Image(width=2, height=1, step=6, encoding="rgb8", data=list(range(6))),
        "/int": Int32(data=-5),
    }
    publishers = {topic: rig.node.create_publisher(type(message), topic) for topic, message in messages.items()}

    @rig.node.timer(0.2)
    def tick() -> None:
        for topic, publisher in publishers.items():
            publisher.publish(messages[topic])

    where = rig.hub.xpub[0]
    with (
        running(old_python, SUBSCRIBER, where, tmp_path / "log") as lines,
        running(old_python, SUBSCRIBER, where, tmp_path / "log2", "odometry") as more,
    ):

        def received() -> dict[str, Any]:
            return dict(json.loads(line) for line in [*lines(), *more()] if line.startswith("["))

        wait_until(lambda: received().keys() == messages.keys(), timeout_s=120, every_s=0.2)
        assert not [line for line in [*lines(), *more()] if "Could not decode" in line]
    found = received()
    assert found["/text"] == {"data": "from Meta-ROS"}
    assert found["/cmd"]["linear"]["x"] == 0.75
    assert found["/odometry"]["pose"]["pose"]["position"]["x"] == 1.25
    assert found["/odometry"]["header"]["stamp"] == 12.0
    assert found["/header"]["stamp"] == 3.5
    assert (found["/laser"]["ranges"], found["/laser"]["angles"]) == ([1.0, float("inf")], [-0.5, -0.25])
    assert (found["/image"]["width"], found["/image"]["encoding"]) == (2, "rgb8")
    assert found["/int"] == {"data": -5}
