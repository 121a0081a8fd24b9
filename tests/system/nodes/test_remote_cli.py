"""`metaros … --robot`: the same words say the same of a robot elsewhere as of this machine's graph. Real programs."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.processes.command_line import ask_metaros
from tests.support.processes.processes import started
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

pytestmark = pytest.mark.integration
ROBOT = "afar_cli"
ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def stack(shared_gateway: Stack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """A simulated robot with its agent, and a gateway that has heard its graph."""
    with shared_gateway.beside(tmp_path_factory.mktemp("remote")) as found:
        found.router()
        found.sim("--no-camera")
        found.agent(ROBOT, namespace="/sim_1")
        wait_until(lambda: ROBOT in found.online(), timeout_s=120)
        wait_until(lambda: "/sim_1/base/resume" in far(found, "service", "list"), timeout_s=120)
        yield found


def run(stack: Stack, *words: str, code: int = 0) -> tuple[str, str]:
    """Standard output and error of `metaros WORDS`."""
    environ = {"METAROS_KEY": stack.key, "METAROS_GATEWAY_URL": stack.url, "METAROS_ZENOH_PORT": str(stack.zenoh_port)}
    found, out, err = asyncio.run(ask_metaros(*words, **environ, NO_COLOR="1"))
    assert found == code, err
    return out, err


def far(stack: Stack, *words: str) -> str:
    """What is said of the robot by its gateway."""
    return run(stack, *words, "--robot", ROBOT)[0]


def both(stack: Stack, *words: str) -> tuple[Any, Any]:
    """What is said by the gateway, and here, as JSON."""
    return json.loads(far(stack, *words, "-o", "json")), json.loads(run(stack, *words, "-o", "json")[0])


def test_the_graph_is_the_same_remotely(stack: Stack) -> None:
    def own(rows: list[dict[str, Any]], key: str) -> list[Any]:
        return sorted((row[key], row["types"]) for row in rows if row[key].startswith("/sim_1/"))

    topics, here = both(stack, "topic", "list")
    assert own(topics, "topic") == own(here, "topic") != []
    services, here = both(stack, "service", "list")
    assert own(services, "service") == own(here, "service") != []
    info, here = both(stack, "topic", "info", "/sim_1/odom")
    assert info["types"] == here["types"]
    ends = {(end["node"], end["kind"], end["qos"]["reliability"]) for end in here["endpoints"]}
    assert {(end["node"], end["kind"], end["qos"]["reliability"]) for end in info["endpoints"]} <= ends
    nodes = far(stack, "node", "list", "--ros").split()
    assert set(nodes) <= set(run(stack, "node", "list")[0].split())
    assert "/sim_1/base" in far(stack, "graph")


def test_topics_are_received_and_written(stack: Stack) -> None:
    message = json.loads(far(stack, "topic", "echo", "odom", "--once", "-o", "json"))
    assert message["child_frame_id"]
    assert "average rate" in far(stack, "topic", "hz", "/sim_1/odom", "-n", "2")
    assert far(stack, "topic", "type", "odom").strip() == "nav_msgs/msg/Odometry"
    out = far(stack, "topic", "pub", "note", "std_msgs/String", "data: from elsewhere", "--once")
    assert "from elsewhere" in out
    _, err = run(stack, "topic", "echo", "/sim_1/odo", "--robot", ROBOT, code=1)
    assert "did you mean /sim_1/odom?" in err
    _, err = run(stack, "topic", "pub", "cmd_vel", "geometry_msgs/Twist", "--once", "--robot", ROBOT, code=1)
    assert "lease" in err


def test_services_and_parameters_answer(stack: Stack) -> None:
    assert json.loads(far(stack, "service", "call", "base/resume", "-o", "json"))["success"] in (True, False)
    listed, here = both(stack, "param", "list", "/sim_1/base")
    assert listed == here
    name = here["parameters"][0]["name"]
    assert far(stack, "param", "get", "base", name) == run(stack, "param", "get", "/sim_1/base", name)[0]
    assert far(stack, "param", "dump", "base") == run(stack, "param", "dump", "/sim_1/base")[0]


def test_a_goal_is_sent_followed_and_cancelled(stack: Stack) -> None:
    environ = {**os.environ, "METAROS_ZENOH_PORT": str(stack.zenoh_port)}
    argv = [sys.executable, str(ROOT / "examples" / "fibonacci_server.py"), "--ros-args", "-r", "__ns:=/sim_1"]
    with started(argv, env=environ):
        wait_until(lambda: "/sim_1/fibonacci" in far(stack, "action", "list"), timeout_s=120)
        lines = far(stack, "action", "send_goal", "fibonacci", "{order: 3}", "--feedback", "-o", "json").splitlines()
        reported = [json.loads(line) for line in lines]
        assert reported[0]["accepted"] is True
        assert "feedback" in reported[1]
        assert reported[-1] == {"status": "SUCCEEDED", "result": {"sequence": [0, 1, 1, 2]}}
        words = ("action", "send_goal", "fibonacci", "{order: 46}", "--robot", ROBOT)
        more = {"METAROS_KEY": stack.key, "METAROS_GATEWAY_URL": stack.url}
        with started([sys.executable, "-u", "-m", "metaros", *words], env={**environ, **more}) as client:
            assert client.stdout is not None
            while "accepted" not in client.stdout.readline():
                assert client.poll() is None
            client.send_signal(signal.SIGINT)
            out, _ = client.communicate(timeout=60)
        assert client.returncode == 130
        assert "CANCELED" in out


def test_nobody_there_is_said_plainly(stack: Stack) -> None:
    _, err = run(stack, "topic", "list", "--robot", "nobody", code=1)
    assert "nobody" in err
    _, err = run(stack, "topic", "list", "--robot", ROBOT, "--gateway", "http://127.0.0.1:1", code=1)
    assert "no gateway answers" in err
