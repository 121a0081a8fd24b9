"""Nodes of a robot by REST, between the real programs: gateway, agent, supervisor, and nodes that are processes."""

from __future__ import annotations

import json
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from metaros.supervise.service import TABLE
from tests.support.processes.stack import Program, Stack
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.integration, pytest.mark.skipif(sys.platform == "win32", reason="kills as POSIX does")]
ROBOT = "remote"
ROOT = Path(__file__).parents[3]
SLEEP = "import time; print('up', flush=True); time.sleep(3600)"
CRASH = "import sys; print('no device', flush=True); sys.exit(3)"


def settings() -> str:
    """What the robot itself lets run."""
    commands = {"sleeper": SLEEP, "crasher": CRASH}
    rows = [
        f"[[allowed]]\nname = {json.dumps(name)}\ncommand = {json.dumps([sys.executable, '-S', '-c', text])}\n"
        for name, text in commands.items()
    ]
    lidar = '[[allowed]]\nname = "lidar-driver"\nclass = "tests.support.nodes.lidar_node:Lidar"\n'
    return "\n".join([*rows, f'{lidar}env = {{ PYTHONPATH = "{ROOT}" }}\n'])


class RemoteRobot:
    """The robot as the gateway's clients see it."""

    def __init__(self, stack: Stack) -> None:
        self.stack = stack
        (stack.folder / "agent.toml").write_text(settings())
        self.state = stack.folder / "robot"
        self.agent = self.start()

    def start(self) -> Program:
        options = ("--state-dir", str(self.state), "--config", str(self.stack.folder / "agent.toml"))
        return self.stack.agent(ROBOT, *options)

    def ask(self, method: str, path: str, body: object = None) -> Any:
        request = urllib.request.Request(
            f"{self.stack.url}/api/v1{path}",
            method=method,
            data=None if body is None else json.dumps(body).encode(),
            headers={"Authorization": f"Bearer {self.stack.key}", "Content-Type": "application/json"},
        )
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            return json.loads(error.read())

    def on(self, method: str, path: str, body: object = None) -> Any:
        return self.ask(method, f"/robots/{ROBOT}/nodes{path}", body)

    def node(self, name: str) -> dict[str, Any]:
        return dict(self.on("GET", f"/{name}"))

    def pid(self, name: str) -> int | None:
        found = self.node(name)
        return found["reported"]["pid"] if found.get("reported") and found["state"] == "running" else None

    def lose_patience(self, name: str) -> None:
        """The robot's supervisor puts this node into quarantine after three exits, instead of eleven in a minute."""
        path = self.state / TABLE
        # The agent tells of a node as soon as it is told of it; its supervisor may be starting still.
        wait_until(lambda: path.exists() and name in path.read_text(), timeout_s=120)
        table = json.loads(path.read_text())
        rows = [{**row, "window_exits": 2} if row["name"] == name else row for row in table["rows"]]
        ask(self.state, "set_table", rows=rows, tag=table["tag"])

    def runs(self, name: str) -> int:
        wait_until(lambda: self.pid(name) is not None, timeout_s=120)
        pid = self.pid(name)
        assert pid is not None
        return pid


@pytest.fixture(scope="module")
def robot(shared_gateway: Stack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RemoteRobot]:
    """One robot; each test names nodes of its own."""
    with shared_gateway.beside(tmp_path_factory.mktemp("remote")) as stack:
        stack.router()
        found = RemoteRobot(stack)
        try:
            wait_until(lambda: ROBOT in stack.online(), timeout_s=120)
            yield found
        finally:
            if running_pid(found.state) is not None:
                if found.agent.process.poll() is not None:
                    found.agent = found.start()  # an agent that lives does not start another one meanwhile
                ask(found.state, "shutdown")
                wait_until(lambda: running_pid(found.state) is None)


def test_nodes_are_started_stopped_and_reported_apart(robot: RemoteRobot) -> None:
    put = robot.on("PUT", "/sleeper?reason=try", {"allowed": "sleeper", "restart": "always"})
    assert (put["changed"], put["revision"]) == (True, robot.ask("GET", f"/robots/{ROBOT}/twin")["revision"])
    first = robot.runs("sleeper")
    assert psutil.pid_exists(first)
    wait_until(lambda: robot.node("sleeper")["in_step"])

    again = robot.on("POST", "/sleeper/restart", {})
    assert (again["outcome"], again["told"], again["changed"]) == ("done", True, False)
    wait_until(lambda: robot.pid("sleeper") not in (None, first), timeout_s=120)
    second = robot.runs("sleeper")
    assert not psutil.pid_exists(first)

    stopped = robot.on("POST", "/sleeper/stop", {})
    assert (stopped["outcome"], stopped["changed"]) == ("done", True)
    assert stopped["changes"] == [{"path": "/nodes/sleeper/run", "verb": "add", "new": False}]
    assert not psutil.pid_exists(second)  # when the answer is there, it is so
    wait_until(lambda: robot.node("sleeper")["state"] == "stopped")
    wait_until(lambda: robot.node("sleeper")["in_step"])

    started = robot.on("POST", "/sleeper/start", {})
    assert (started["outcome"], started["changed"]) == ("done", True)
    third = robot.runs("sleeper")
    assert third not in (first, second)
    killed = robot.on("POST", "/sleeper/signal", {"signal": 9})
    assert killed["outcome"] == "done"
    wait_until(lambda: robot.node("sleeper")["reported"]["crashes"] >= 1, timeout_s=120)
    wait_until(lambda: robot.pid("sleeper") not in (None, third), timeout_s=120)
    assert robot.on("POST", "/nobody/start", {})["code"] == "unknown_node"
    assert robot.on("POST", "/sleeper/signal", {})["code"] == "invalid_request"


def test_what_an_offline_robot_is_reported_it_does_when_it_is_back(robot: RemoteRobot) -> None:
    robot.on("PUT", "/late", {"allowed": "sleeper"})
    first = robot.runs("late")
    assert robot.on("POST", "/late/stop", {})["outcome"] == "done"
    wait_until(lambda: robot.node("late")["in_step"])
    robot.agent.kill()
    wait_until(lambda: not robot.node("late")["online"], timeout_s=120)
    later = robot.on("POST", "/late/start", {})
    assert (later["outcome"], later["told"], later["code"]) == ("pending", False, "robot_offline")
    shown = robot.node("late")
    assert (shown["wanted"], shown["state"], shown["online"]) == ("running", "stopped", False)
    assert robot.on("POST", "/late/restart", {})["code"] == "robot_offline"
    robot.agent = robot.start()
    second = robot.runs("late")  # though it was stopped by hand on the robot, too: the newer word counts
    assert second != first
    wait_until(lambda: robot.node("late")["in_step"])


def test_a_crashing_node_is_seen_with_its_log_and_its_reports(robot: RemoteRobot) -> None:
    robot.on("PUT", "/crasher", {"allowed": "crasher", "restart": "always"})
    wait_until(lambda: robot.node("crasher").get("reported"))
    robot.lose_patience("crasher")
    wait_until(lambda: robot.node("crasher")["state"] == "quarantined", timeout_s=240)
    found = robot.node("crasher")
    (difference,) = found["differs"]
    assert (difference["what"], difference["desired"], difference["reported"]) == ("state", "running", "quarantined")
    assert "exit code 3" in difference["why"]
    listed = robot.ask("GET", "/nodes?state=quarantined")["nodes"]
    assert [(item["robot"], item["name"]) for item in listed] == [(ROBOT, "crasher")]
    page = robot.on("GET", "/crasher/log?query=DEVICE")
    assert {line["text"] for line in page["lines"]} == {"no device"}
    assert robot.on("GET", "/crasher/log?query=other")["lines"] == []
    reports = robot.on("GET", "/crasher/crashes")["crashes"]
    assert len(reports) >= 3
    assert reports[0]["at"] > reports[-1]["at"]
    assert "exit code 3" in reports[0]["reason"]
    assert reports[0]["lines"][-1].endswith("no device")
    assert robot.on("POST", "/crasher/retry", {})["outcome"] == "done"
    wait_until(lambda: robot.node("crasher")["reported"]["crashes"] > found["reported"]["crashes"], timeout_s=120)


def test_parameters_and_lifecycle_of_a_running_node(robot: RemoteRobot) -> None:
    revision = robot.on("PUT", "/lidar", {"allowed": "lidar-driver", "parameters": {"beams": 180}})["revision"]
    robot.runs("lidar")
    wait_until(lambda: "parameters" in robot.on("GET", "/lidar/parameters"), timeout_s=120)
    found = {item["name"]: item for item in robot.on("GET", "/lidar/parameters")["parameters"]}
    assert (found["beams"]["type"], found["beams"]["value"]) == ("integer", 180)
    assert (found["serial"]["read_only"], found["frames"]["value"]) == (True, ["laser", "base"])
    assert found["rate_hz"]["floating_point_range"] == {"from": 1.0, "to": 20.0, "step": 0.0}

    bad = robot.on("PATCH", "/lidar/parameters", {"parameters": {"rate_hz": 99, "serial": "B", "beams": "many"}})
    assert [item["successful"] for item in bad["results"]] == [False, False, False]
    tried = robot.on("PATCH", "/lidar/parameters?dry_run=true", {"parameters": {"rate_hz": 5}, "keep": True})
    assert [item["successful"] for item in tried["results"]] == [True]
    kept = robot.on("PATCH", "/lidar/parameters", {"parameters": {"rate_hz": 15, "beams": "90"}, "keep": True})
    assert [item["reason"] for item in kept["results"] if not item["successful"]] == []
    assert kept["revision"] == revision + 1
    values = {item["name"]: item for item in robot.on("GET", "/lidar/parameters")["parameters"]}
    assert (values["rate_hz"]["value"], values["rate_hz"]["desired"], values["beams"]["value"]) == (15.0, 15, 90)

    first = robot.runs("lidar")
    robot.on("POST", "/lidar/restart", {})
    wait_until(lambda: robot.pid("lidar") not in (None, first), timeout_s=120)

    def rate() -> Any:
        items = robot.on("GET", "/lidar/parameters").get("parameters", [])
        return next((item["value"] for item in items if item["name"] == "rate_hz"), None)

    wait_until(lambda: rate() == 15.0, timeout_s=120)  # the twin sees to it after each start

    state = robot.on("GET", "/lidar/lifecycle")
    assert (state["managed"], state["state"], state["transitions"]) == (True, "unconfigured", ["configure", "shutdown"])
    assert robot.on("POST", "/lidar/lifecycle", {"transition": "activate"})["success"] is False
    done = robot.on("POST", "/lidar/lifecycle", {"transition": "configure", "keep": True})
    assert (done["success"], done["state"], done["wanted"]) == (True, "inactive", "inactive")
    log = robot.on("GET", "/lidar/log?query=configured")
    assert log["lines"][-1]["text"] == "lidar configured"
    nothing = robot.on("GET", f"/lidar/parameters?ros_name=/{ROBOT}/nobody")
    assert nothing["code"] == "unavailable"


def test_a_tail_goes_on_where_it_was(robot: RemoteRobot) -> None:
    robot.on("PUT", "/tailed", {"allowed": "lidar-driver"})
    first = robot.runs("tailed")
    request = urllib.request.Request(f"{robot.stack.url}/api/v1/robots/{ROBOT}/nodes/tailed/log/tail?query=started")
    seen: list[str] = []
    with urllib.request.urlopen(request, timeout=120) as events:
        assert events.headers["Content-Type"].startswith("text/event-stream")
        for raw in events:
            line = raw.decode().rstrip("\n")
            if not line.startswith("data: "):
                continue
            seen += [item["text"] for item in json.loads(line.removeprefix("data: "))["lines"]]
            if len(seen) == 1:
                assert seen == [f"lidar started as {first}"]
                robot.on("POST", "/tailed/restart", {})
            if len(seen) == 2:
                break
    wait_until(lambda: robot.pid("tailed") not in (None, first))  # the line may come before the report
    assert seen[1] == f"lidar started as {robot.pid('tailed')}"
