"""Unmodified clients of rosbridge do their whole day's work with a real robot: npm roslib, PyPI roslibpy."""

from __future__ import annotations

import asyncio
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.edge_agent.conftest import Robot
from tests.edge_agent.conftest import robot as robot
from tests.gateway.harness import OPERATOR_KEY
from tests.support.gateways.bridged_robot import ADD, FIBONACCI, BridgedRobot, Script, bridged_robot
from tests.support.waiting import wait_until_async

ROOT = Path(__file__).parents[3]
MODULES = ROOT / "dashboard" / "node_modules"
FOLDER = ROOT / "tests" / "clients"
STRING, SCAN = "std_msgs/msg/String", "sensor_msgs/msg/LaserScan"
SHOWN = {"ranges": [1.0, None, None, 2.0], "count": 203, "max": 9.5}


def address(world: BridgedRobot) -> str:
    """Where the gateway's rosbridge is, for an operator."""
    return f"ws://127.0.0.1:{world.ready.rosbridge_port}/sim_1?token={OPERATOR_KEY}"


async def asked_of(world: BridgedRobot, service: str) -> int:
    """What a node of the robot gets from a service that the client serves."""
    caller = world.node.create_client(ADD, service)
    assert await asyncio.to_thread(caller.wait_for_service, 60)
    return int((await caller.call_async(ADD.Request(a=1, b=2), 60)).sum)


def check_looks(steps: dict[str, Any]) -> None:
    """What both clients are told of the graph."""
    assert {"/sim_1/add", "/sim_1/base/list_parameters"} <= set(steps["services"])
    assert "/sim_1/base" in steps["nodes"]
    assert (steps["topic_type"], steps["service_type"]) == (STRING, "example_interfaces/srv/AddTwoInts")
    assert steps["chatter"] == {"data": "hello"}


@pytest.mark.integration
@pytest.mark.skipif(shutil.which("node") is None and "CI" not in os.environ, reason="needs Node.js")
async def test_roslib(tmp_path: Path, zenoh_router: str, robot: Robot) -> None:
    async with bridged_robot(robot, zenoh_router, tmp_path) as world:
        command = ("node", str(FOLDER / "roslib_scenario.mjs"), str(MODULES), address(world))
        async with Script.running(*command, **os.environ) as script:
            await script.until("published")
            steps = script.steps
            check_looks(steps)
            types = dict(zip(steps["topics"]["topics"], steps["topics"]["types"], strict=True))
            assert (types["/sim_1/chatter"], types["/sim_1/scan"]) == (STRING, SCAN)
            assert "/sim_1/count" in steps["actions"]
            assert "/sim_1/echo" in steps["node"]["subscribing"]
            assert "/sim_1/chatter" in steps["of_type"]
            assert steps["raw_types"] >= 2
            assert steps["typedef"]["ranges"] == ["float32"]
            assert steps["typedef"]["header"]["stamp"]["sec"] == "int32"
            assert steps["request"][0]["fieldnames"] == ["a", "b"]
            for compression in ("plain", "throttled", "png", "fragments"):
                assert steps[compression] == SHOWN, compression
            assert steps["cbor"] == {**SHOWN, "kind": "Float32Array"}
            assert steps["cbor_raw"]["size"] > 203 * 4
            await wait_until_async(lambda: len(world.heard) == 20)
            assert world.heard == [f"js {number}" for number in range(20)]
            await script.go_on()

            await script.until("serving")
            assert steps["sum"] == {"sum": 42}
            assert steps["refused"] != "answered"
            assert await asked_of(world, "js_add") == 1003
            await script.go_on()

            await script.until("working")
            assert steps["goal"]["result"] == {"sequence": list(range(8))}
            assert steps["goal"]["feedback"] > 0
            assert "canceled" in steps["cancelled"]["failure"]
            await carried_out(world)
            await script.go_on()

            await script.until("done")
            assert steps["params"] == ["/sim_1/base:speed"]
            assert (steps["speed"], steps["faster"]) == (1.5, 2.5)
            assert steps["unknown"] != "there"
            assert (steps["status"]["level"], steps["status"]["code"]) == ("error", "invalid_field")


async def carried_out(world: BridgedRobot) -> None:
    """Goals of a node of the robot, worked on by the client: one ends well, one is cancelled."""
    sender = world.node.create_action_client(FIBONACCI, "js_count")
    assert await asyncio.to_thread(sender.wait_for_server, 60)
    received: list[Any] = []
    goal = await sender.send_goal(FIBONACCI.Goal(order=4), feedback=received.append, timeout_s=60)
    done = await goal.result(60)
    assert (done.status.name, list(done.result.sequence)) == ("SUCCEEDED", [4])
    await wait_until_async(lambda: received)  # feedback comes by another way than the result
    assert list(received[0].sequence) == [1]
    received.clear()
    long = await sender.send_goal(FIBONACCI.Goal(order=1000), feedback=received.append, timeout_s=60)
    await wait_until_async(lambda: received)  # the client has it: a goal that still waits for its turn ends without it
    assert await long.cancel(60)
    done = await long.result(60)
    assert (done.status.name, list(done.result.sequence)) == ("CANCELED", [7])


@pytest.mark.integration
async def test_roslibpy(tmp_path: Path, zenoh_router: str, robot: Robot) -> None:
    async with bridged_robot(robot, zenoh_router, tmp_path) as world:
        command = (sys.executable, str(FOLDER / "roslibpy_scenario.py"), address(world))
        async with Script.running(*command, **os.environ) as script:
            await script.until("published")
            steps = script.steps
            check_looks(steps)
            assert {"/sim_1/chatter", "/sim_1/scan"} <= set(steps["topics"])
            assert steps["scan"] == [1.0, None, None, 2.0]
            assert steps["time"]["secs"] > 1e9
            assert steps["details"]["typedefs"][0]["fieldnames"] == ["data"]
            await wait_until_async(lambda: len(world.heard) == 20)
            assert world.heard == [f"py {number}" for number in range(20)]
            await script.go_on()
            await script.until("serving")
            assert steps["sum"] == {"sum": 7}
            assert await asked_of(world, "py_add") == 2003
            await script.go_on()
            await script.until("done")
            assert (steps["goal"]["status"], steps["goal"]["values"]) == ("SUCCEEDED", {"sequence": list(range(6))})
            assert steps["goal"]["feedback"] > 0
            assert steps["cancelled"]["status"] == "CANCELED"
            assert (steps["speed"], steps["faster"]) == (1.5, 3.25)
            assert steps["params"] == ["/sim_1/base:speed"]
