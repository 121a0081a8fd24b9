"""Real ROS 2 as a participant: the `ros2` command, and tests/ros2/programs/robot.py on its own rclpy."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.ros2.installation import outputs
from tests.ros2.installation.commands import Installation, Running
from tests.ros2.participant import Fields, GoalRun, Seen
from tests.support.waiting import wait_until

__all__ = ["RosPeer"]

ROBOT = Path(__file__).parents[1] / "programs" / "robot.py"
RELIABLE = ("--qos-reliability", "reliable")
VOLATILE = (*RELIABLE, "--qos-durability", "volatile", "--qos-depth", "10")
LATCHED = (*RELIABLE, "--qos-durability", "transient_local", "--qos-depth", "1")
FIBONACCI = "example_interfaces/action/Fibonacci"


class RosPeer:
    """What it tells comes from the robot program or from `ros2 topic pub`; what it hears, `ros2` prints."""

    def __init__(self, folder: str, router: str, name: str = "ros") -> None:
        self.name = name
        self._folder = tempfile.TemporaryDirectory(prefix="metaros_conformance_")
        self.ros = Installation(folder, router, Path(self._folder.name))
        self._robot = self.ros.start("python3", str(ROBOT), name)
        self._running: list[Running] = []

    @contextmanager
    def lending(self) -> Iterator[None]:
        """See `Participant`."""
        yield
        while self._running:
            self._running.pop().stop()

    def _start(self, *arguments: str) -> Running:
        running = self.ros.start(*arguments)
        self._running.append(running)
        return running

    def speak(self, topic: str, type_name: str, fields: Fields, *, latched: bool = False) -> Callable[[], object]:
        """Once and kept, or ten times a second from the first word on."""
        started: list[Running] = []
        often = ("--times", "1", "-w", "0", "--keep-alive", "60", *LATCHED) if latched else VOLATILE

        def say() -> None:
            if not started:
                text = json.dumps(fields).replace("Infinity", ".inf")  # JSON is YAML but for this
                started.append(self._start("ros2", "topic", "pub", "-r", "10", *often, topic, type_name, text))
                wait_until(lambda: "publishing #1" in started[0].text())

        return say

    def listen(self, topic: str, type_name: str, *, latched: bool = False) -> Callable[[], list[Fields]]:
        """What `echo` has printed so far."""
        qos = LATCHED if latched else VOLATILE
        running = self._start("ros2", "topic", "echo", "--full-length", *qos, topic, type_name)
        return lambda: outputs.messages(running.text())

    def call(self, service: str, type_name: str, request: Fields) -> Fields:
        """By `ros2 service call`, which waits until the service is there."""
        return outputs.response(self.ros.ask("ros2", "service", "call", service, type_name, json.dumps(request)))

    def add(self, server: str, a: int, b: int) -> int:
        """See `Participant`."""
        return int(self.call(f"/{server}/add", "example_interfaces/srv/AddTwoInts", {"a": a, "b": b})["sum"])

    def now(self, server: str) -> int:
        """See `Participant`."""
        return int(self.call(f"/{server}/now", "std_srvs/srv/Trigger", {})["message"])

    def run_goal(self, server: str, order: int, *, cancel: bool = False) -> GoalRun:
        """The cancel is asked of the service below the action, for all goals: Ctrl-C would end the client, too."""
        action, goal = f"/{server}/fibonacci", json.dumps({"order": order})
        running = self._start("ros2", "action", "send_goal", "--feedback", action, FIBONACCI, goal)
        if cancel:
            wait_until(lambda: "Goal accepted" in running.text())
            assert self.call(f"{action}/_action/cancel_goal", "action_msgs/srv/CancelGoal", {})["return_code"] == 0
        return outputs.goal_run(running.wait())

    def parameters(self, node: str) -> dict[str, Any]:
        """All names, and the value of `speed`."""
        listed = outputs.names(self.ros.look("ros2", "param", "list", f"/{node}"))
        value = outputs.parameter(self.ros.look("ros2", "param", "get", f"/{node}", "speed"))
        return {**dict.fromkeys(listed), "speed": value}

    def set_parameter(self, node: str, name: str, value: object) -> str | None:
        """See `Participant`."""
        text = value if isinstance(value, str) else json.dumps(value)
        return outputs.refusal(self.ros.look("ros2", "param", "set", f"/{node}", name, text))

    def state(self, node: str) -> str:
        """See `Participant`."""
        return outputs.state(self.ros.look("ros2", "lifecycle", "get", f"/{node}"))

    def change_state(self, node: str, transition: str) -> bool:
        """See `Participant`."""
        return "Transitioning successful" in self.ros.look("ros2", "lifecycle", "set", f"/{node}", transition)

    def nodes(self) -> set[str]:
        """See `Participant`."""
        return set(outputs.names(self.ros.look("ros2", "node", "list")))

    def endpoints(self, topic: str) -> list[Seen]:
        """See `Participant`."""
        return outputs.endpoints(self.ros.look("ros2", "topic", "info", "-v", topic))

    def describe(self, node: str, type_name: str, type_hash: str) -> list[Fields]:
        """See `Participant`."""
        request = {"type_name": type_name, "type_hash": type_hash, "include_type_sources": False}
        service = "type_description_interfaces/srv/GetTypeDescription"
        answer = self.call(f"/{node}/get_type_description", service, request)
        assert answer["successful"], answer["failure_reason"]
        told = answer["type_description"]
        return [told["type_description"], *told["referenced_type_descriptions"]]

    def close(self) -> None:
        """See `Participant`."""
        self._robot.stop()
        self._folder.cleanup()
