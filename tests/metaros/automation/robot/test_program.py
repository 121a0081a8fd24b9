"""The whole of it on a real router: topics in, the handler called in a worker, results and actions out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from metaros.automation.robot.backlog import Backlog
from metaros.automation.robot.policy import FunctionPolicy
from metaros.automation.robot.program import open_package
from metaros.errors import ConfigError
from metaros.idl import message_class
from metaros.idl.globs import Glob
from metaros.interfaces.sensor_msgs.msg import BatteryState
from metaros.interfaces.std_msgs.msg import String
from tests.edge_agent.conftest import Robot
from tests.support.functions.robot_function import ReceivedResults, function_zip, running_function, write_function
from tests.support.waiting import wait_until_async

TRIGGER = message_class("std_srvs/srv/Trigger")
LOW = {"detail": {"message": {"percentage": [{"numeric": ["<", 0.2]}]}}}
DOCK = """
def handler(event, context):
    low = event["detail"]["message"]["percentage"]
    return {
        "call": [{"service": "dock", "type": "std_srvs/srv/Trigger"}],
        "publish": [{"topic": "notes", "type": "std_msgs/msg/String", "message": {"data": f"docking at {low:.2f}"}}],
    }
"""
MOVE = """
def handler(event, context):
    topic = event["detail"]["message"]["data"]
    return {"publish": [{"topic": "notes", "type": "std_msgs/msg/String", "message": {"data": "first"}},
                        {"topic": topic, "type": "geometry_msgs/msg/Twist", "message": {"linear": {"x": 1.0}}}]}
"""


async def seen(robot: Robot, topic: str, kind: str = "MS") -> None:
    """Until the function's end of a topic is in the robot's graph."""
    await wait_until_async(
        lambda: any("function" in end.node_full_name for end in robot.node.graph.endpoints(topic, kind))
    )


async def test_a_low_battery_docks_the_robot_without_any_link(robot: Robot, zenoh_router: str, tmp_path: Path) -> None:
    docked: list[Any] = []
    notes: list[str] = []
    robot.node.create_service(TRIGGER, "dock", lambda request, response: docked.append(request))
    robot.node.create_subscription(String, "notes", lambda message: notes.append(message.data))
    received = ReceivedResults.on(robot.node)
    trigger = {"topic": "battery_state", "pattern": LOW, "when": {"edge": "rising"}}
    package = write_function(tmp_path / "dock", DOCK, name="dock-when-low", triggers=[trigger])
    battery = robot.node.create_publisher(BatteryState, "battery_state")
    async with running_function(package, tmp_path / "state", zenoh_router):
        await seen(robot, "/sim_1/battery_state")
        for percentage in (0.5, 0.19, 0.18, 0.17):
            battery.publish(BatteryState(percentage=percentage))
        await wait_until_async(lambda: received.results)
    result = received.results[0]
    assert len(received.results) == len(docked) == 1
    assert notes == ["docking at 0.19"]
    assert (result["status"], result["function"], result["robot"]) == ("ok", "dock-when-low", "sim_1")
    assert [action["kind"] for action in result["actions"]] == ["publish", "call"]


@pytest.mark.parametrize("allowed", [False, True])
async def test_what_moves_the_robot_is_refused_unless_its_own_settings_allow_it(
    robot: Robot, zenoh_router: str, tmp_path: Path, allowed: bool
) -> None:
    moves: list[float] = []
    notes: list[str] = []
    twist = message_class("geometry_msgs/msg/Twist")
    robot.node.create_subscription(twist, "cmd_vel", lambda message: moves.append(message.linear.x))
    robot.node.create_subscription(String, "notes", lambda message: notes.append(message.data))
    received, words = ReceivedResults.on(robot.node), robot.node.create_publisher(String, "word")
    policy = FunctionPolicy("/sim_1", allowed=(Glob("**/cmd_vel"),)) if allowed else FunctionPolicy("/sim_1")
    package = write_function(tmp_path / "move", MOVE)
    async with running_function(package, tmp_path / "state", zenoh_router, policy=policy):
        await seen(robot, "/sim_1/word")
        words.publish(String(data="cmd_vel"))
        await wait_until_async(lambda: received.results and (not allowed or moves))
    result = received.results[0]
    if allowed:
        assert (result["status"], moves, notes) == ("ok", [1.0], ["first"])
        return
    assert (result["status"], result["error_type"], result["attempt"]) == ("dead", "action_refused", 1)
    assert "function_actuators" in result["error_message"]
    assert moves == notes == []  # all is checked before any of it is done


async def test_what_waits_when_the_program_ends_is_done_by_its_next_life(
    robot: Robot, zenoh_router: str, tmp_path: Path
) -> None:
    package, state = write_function(tmp_path / "echo"), tmp_path / "state"
    words = robot.node.create_publisher(String, "word")
    async with running_function(package, state, zenoh_router):
        await seen(robot, "/sim_1/word")
        for number in range(20):
            words.publish(String(data=str(number)))

        def done() -> bool:
            backlog = Backlog(state / "backlog.sqlite3")
            try:
                return backlog.counts().unsent == 20  # nobody listens
            finally:
                backlog.close()

        await wait_until_async(done)
    received = ReceivedResults.on(robot.node)
    async with running_function(package, state, zenoh_router):
        await wait_until_async(lambda: len(received.results) >= 20)
    said = [result["payload"]["detail"]["message"]["data"] for result in received.results]
    assert said == [str(number) for number in range(20)]


async def test_the_very_same_zip_runs_from_a_file(robot: Robot, zenoh_router: str, tmp_path: Path) -> None:
    folder = write_function(tmp_path / "echo")
    function_zip(folder)
    received, words = ReceivedResults.on(robot.node), robot.node.create_publisher(String, "word")
    async with running_function(tmp_path / "echo.zip", tmp_path / "state", zenoh_router):
        await seen(robot, "/sim_1/word")
        words.publish(String(data="hello"))
        await wait_until_async(lambda: received.results)
    event = received.results[0]["payload"]
    assert event["detail-type"] == "metaros.topic.message"
    assert event["detail"]["message"] == {"data": "hello"}


def test_a_package_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such folder"):
        open_package(tmp_path / "nothing", tmp_path)
    with pytest.raises(ConfigError, match=r"function\.yaml"):
        open_package(tmp_path, tmp_path)
