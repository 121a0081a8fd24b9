"""Programs for ROS 2, in a package that nobody has built, as processes: they meet, answer, and end by Ctrl-C."""

from __future__ import annotations

import os
import re
import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from subprocess import STDOUT, Popen
from typing import Any

import pytest

from tests.support.processes.command_line import program
from tests.support.processes.processes import END_S, started
from tests.support.servers.routers import zenoh_router
from tests.support.waiting import wait_until

pytestmark = pytest.mark.integration

PROGRAMS = {
    "talker": """
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String


class Talker(Node):
    def __init__(self):
        super().__init__('talker')
        self.count = 0
        self.pub = self.create_publisher(String, 'chatter', 10)
        self.timer = self.create_timer(0.1, self.talk)

    def talk(self):
        self.pub.publish(String(data=f'Hello {self.count}'))
        self.get_logger().info(f'Publishing: {self.count}')
        self.count += 1


def main(args=None):
    try:
        with rclpy.init(args=args):
            rclpy.spin(Talker())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
""",
    "listener": """
import rclpy


def main():
    rclpy.init()
    node = rclpy.create_node('listener')
    node.create_subscription(rclpy_string(), 'chatter', lambda msg: node.get_logger().info(f'I heard: {msg.data}'), 10)
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        node.get_logger().info('stopped by hand')
    finally:
        node.destroy_node()
        rclpy.shutdown()


def rclpy_string():
    from std_msgs.msg import String
    return String
""",
    "adder": """
import rclpy
from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from rclpy.action import ActionServer
from rclpy.executors import MultiThreadedExecutor


def add(request, response):
    response.sum = request.a + request.b
    return response


def execute(goal_handle):
    found = [0, 1]
    for _ in range(1, goal_handle.request.order):
        found.append(found[-1] + found[-2])
        goal_handle.publish_feedback(Fibonacci.Feedback(sequence=found))
    goal_handle.succeed()
    return Fibonacci.Result(sequence=found)


def main():
    rclpy.init()
    node = rclpy.create_node('adder')
    node.create_service(AddTwoInts, 'add_two_ints', add)
    ActionServer(node, Fibonacci, 'fibonacci', execute)
    rclpy.spin(node, executor=MultiThreadedExecutor())
""",
    "asker": """
import sys
import rclpy
from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from rclpy.action import ActionClient


def main():
    rclpy.init()
    node = rclpy.create_node('asker')
    client = node.create_client(AddTwoInts, 'add_two_ints')
    while not client.wait_for_service(timeout_sec=0.2):
        print('waiting for the service')
    future = client.call_async(AddTwoInts.Request(a=41, b=1))
    rclpy.spin_until_future_complete(node, future)
    print('sum', future.result().sum)
    actions = ActionClient(node, Fibonacci, 'fibonacci')
    actions.wait_for_server()
    future = actions.send_goal_async(Fibonacci.Goal(order=5))
    rclpy.spin_until_future_complete(node, future)
    future = future.result().get_result_async()
    rclpy.spin_until_future_complete(node, future)
    print('sequence', list(future.result().result.sequence))
    node.destroy_node()
    rclpy.shutdown()
    return len(sys.argv)
""",
}
LAUNCH = """
from launch import LaunchDescription
from launch.actions import ExecuteProcess
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage


def generate_launch_description():
    return LaunchDescription([
        ExecuteProcess(cmd=[ExecutableInPackage(package='demos', executable='talker')], output='screen'),
        Node(package='demos', executable='listener', name='hearer', remappings=[('chatter', '/chatter')],
             output='both'),
    ])
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The package."""
    package = tmp_path / "src" / "demos"
    (package / "demos").mkdir(parents=True)
    (package / "launch").mkdir()
    (package / "package.xml").write_text("<package><name>demos</name></package>")
    scripts = [f"{name} = demos.{name}:main" for name in PROGRAMS]
    (package / "setup.py").write_text(f"setup(name='demos', entry_points={{'console_scripts': {scripts!r}}})")
    (package / "launch" / "both.launch.py").write_text(LAUNCH)
    (package / "demos" / "__init__.py").touch()
    for name, text in PROGRAMS.items():
        (package / "demos" / f"{name}.py").write_text(text)
    return tmp_path


class Running:
    """A process, and what it has printed."""

    def __init__(self, process: Popen[str]) -> None:
        self.process = process
        self.text = ""
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.text += line

    def prints(self, pattern: str) -> None:
        """Wait for it."""
        wait_until(lambda: re.search(pattern, self.text, re.MULTILINE) or self.process.poll() is not None)
        assert re.search(pattern, self.text, re.MULTILINE), self.text

    def ends(self, code: int, *, interrupt: bool = False) -> str:
        """Its output, once it has ended, by Ctrl-C if need be."""
        if interrupt:
            self.process.send_signal(signal.SIGINT)
        ended = self.process.wait(END_S)
        self._reader.join(END_S)
        assert ended == code, self.text
        return self.text


@pytest.fixture
def run(folder: Path) -> Iterator[Any]:
    """Start `metaros ros2 …` on a router of this test."""
    with ExitStack() as stack:
        port = stack.enter_context(zenoh_router()).rpartition(":")[2]
        environ = {
            **os.environ,
            "METAROS_ZENOH_PORT": port,
            "PYTHONUNBUFFERED": "1",
            "ROS_LOG_DIR": str(folder / "log"),
        }

        def start(*words: str) -> Running:
            options: dict[str, Any] = {"cwd": folder, "env": environ, "stderr": STDOUT, "start_new_session": True}
            return Running(stack.enter_context(started(program("ros2", *words), **options)))

        yield start


def test_programs_meet_and_end(run: Any) -> None:
    asker = run("run", "demos", "asker", "one", "--ros-args", "-r", "__ns:=/")
    asker.prints("waiting for the service")
    adder, talker, listener = (run("run", "demos", name) for name in ("adder", "talker", "listener"))
    listener.prints(r"^\[INFO\] \[\d+\.\d{9}\] \[listener\]: I heard: Hello \d+$")
    assert asker.ends(5).endswith("sum 42\nsequence [0, 1, 1, 2, 3, 5]\n")
    assert listener.ends(0, interrupt=True).endswith("[listener]: stopped by hand\n")
    assert "Traceback" not in talker.ends(0, interrupt=True)
    assert adder.ends(130, interrupt=True) == ""


def test_a_launch_file_of_the_package(run: Any) -> None:
    launch = run("launch", "demos", "both.launch.py")
    launch.prints(r"^\[talker-1\] \[INFO\] \[[\d.]+\] \[talker\]: Publishing: \d+$")
    launch.prints(r"^\[listener-2\] \[INFO\] \[[\d.]+\] \[hearer\]: I heard: Hello \d+$")
    text = launch.ends(0, interrupt=True)
    assert "[hearer]: stopped by hand" in text
    assert "Traceback" not in text
