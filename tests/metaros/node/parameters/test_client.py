"""Parameters over the wire between two nodes: the client, events, overrides, and a closed node."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from typing import Any

import pytest

import metaros
from metaros.errors import ConfigError, ParameterError, UnavailableError
from metaros.idl import type_hash
from metaros.interfaces.rcl_interfaces.msg import ParameterEvent
from metaros.node.introspection import logger_levels, type_description
from metaros.node.parameters import ParameterType, Range, SetResult, services
from metaros.wire import qos_parameters
from tests.support.waiting import wait_until


@pytest.fixture
def robot(there: metaros.Context) -> Iterator[metaros.Node]:
    with metaros.Node("robot", namespace="/ns", context=there) as node:
        node.declare_parameter("speed", 0.5, minimum=0.0, maximum=1.0, step=0.25, description="m/s")
        node.declare_parameter("mode", "auto", choices=("auto", "manual"))
        node.declare_parameter("motor.id", 7, read_only=True)
        node.declare_parameter("motor.gains", [1.0, 2.0])
        node.declare_parameter("motor.raw", b"\x00\xff")
        node.declare_parameter("tags", [], parameter_type=list[str])
        node.declare_parameter("late", parameter_type=float)
        node.declare_parameter("any", 1, dynamic_typing=True)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield node
        executor.shutdown()
        thread.join()


@pytest.fixture
def client(here: metaros.Context, robot: metaros.Node) -> Iterator[Any]:
    with metaros.Node("asker", context=here) as node:
        client = node.create_parameter_client("/ns/robot")
        assert client.wait()
        yield client


VALUES = {
    "use_sim_time": False,
    "speed": 0.5,
    "mode": "auto",
    "motor.id": 7,
    "motor.gains": [1.0, 2.0],
    "motor.raw": b"\x00\xff",
    "tags": [],
    "late": None,
    "any": 1,
}


def test_the_written_down_hashes_are_those_of_the_types():
    for service in (*services.SERVICES, *logger_levels.SERVICES, type_description.SERVICE):
        assert service.type_hash == type_hash(service.type_name)
    assert type_hash(services.EVENT_TYPE) == services.EVENT_HASH


def test_values_types_and_rules_are_read(client):
    assert client.list() == list(VALUES)
    assert client.list(["motor"]) == ["motor.id", "motor.gains", "motor.raw"]
    assert client.list(depth=1) == ["use_sim_time", "speed", "mode", "tags", "late", "any"]
    assert client.dump() == VALUES
    assert client.get(["speed", "none"]) == {"speed": 0.5, "none": None}
    kinds = client.types(["tags", "late", "motor.raw", "none"])
    assert list(kinds.values()) == [
        ParameterType.STRING_ARRAY,
        ParameterType.NOT_SET,
        ParameterType.BYTE_ARRAY,
        ParameterType.NOT_SET,
    ]
    rules = client.describe(["speed", "mode", "motor.id", "late", "any", "none"])
    assert rules["speed"].range == Range(0.0, 1.0, 0.25)
    assert rules["speed"].description == "m/s"
    assert rules["mode"].words == "one of auto, manual"
    assert rules["motor.id"].read_only
    assert rules["late"].kind is ParameterType.DOUBLE
    assert rules["any"].dynamic_typing
    assert "none" not in rules


def test_sets_are_obeyed_refused_and_atomic(robot, client):
    results = client.set({"speed": 0.75, "mode": "asleep", "none": 1, "any": None})
    assert results["speed"]
    assert results["any"]
    assert results["mode"] == SetResult(False, "mode: 'asleep' is none of 'auto', 'manual'")
    assert results["none"] == SetResult(False, "none: it was not declared")
    assert (robot.parameters["speed"], "any" in robot.parameters) == (0.75, False)
    refused = client.set_atomically({"speed": 0.25, "motor.id": 8})
    assert not refused
    assert refused.reason == "motor.id: it is read-only"
    assert robot.parameters["speed"] == 0.75
    assert client.set_atomically({"speed": 0.25, "motor.gains": [0.5], "tags": ["a"], "late": 1.0})
    assert robot.parameters.get("late") == 1.0
    assert client.get(["motor.gains", "tags"]) == {"motor.gains": [0.5], "tags": ["a"]}


async def test_every_call_has_its_coroutine(client):
    assert await client.list_async() == list(VALUES)
    assert await client.dump_async() == VALUES
    assert (await client.set_async({"speed": 1.0}))["speed"]
    assert await client.set_atomically_async({"mode": "manual"})
    assert await client.get_async(["speed", "mode"]) == {"speed": 1.0, "mode": "manual"}
    assert (await client.types_async(["mode"]))["mode"] is ParameterType.STRING
    assert "mode" in await client.describe_async(["mode"])
    assert await asyncio.gather(*(client.get_async(["any"]) for _ in range(20))) == [{"any": 1}] * 20


def test_an_absent_node_is_unavailable_at_once(here):
    with metaros.Node("asker", context=here) as node:
        client = node.create_parameter_client("nobody")
        assert not client.wait(0.05)
        with pytest.raises(UnavailableError, match="/nobody/list_parameters"):
            client.list()
        client.close()


def test_changes_are_received_by_others(here, there):
    got: list[Any] = []
    with metaros.Node("listener", context=here) as listener, metaros.Node("robot", context=there) as robot:
        listener.create_subscription(ParameterEvent, "/parameter_events", got.append, qos_parameters)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(listener)
        robot.declare_parameter("tags", [], parameter_type=list[str])

        def received() -> bool:
            robot.parameters["tags"] = []
            executor.spin_once(0.05)
            return any(event.changed_parameters for event in got)

        wait_until(received)
        event = next(event for event in got if event.changed_parameters)
        assert (event.node, event.stamp.sec > 0) == ("/robot", True)
        assert [(item.name, item.value.type) for item in event.changed_parameters] == [("tags", 9)]
        got.clear()
        robot.parameters.undeclare("tags")
        robot.declare_parameter("new", True)
        wait_until(lambda: executor.spin_once(0.05) and any(event.new_parameters for event in got))
        names = [[item.name for item in (*event.new_parameters, *event.deleted_parameters)] for event in got]
        assert names[-2:] == [["tags"], ["new"]]


def test_a_file_and_the_program_override_defaults(here, tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text("/**: {ros__parameters: {speed: 1, name: file, other: 3}}\n")
    overrides = {"name": "program"}
    with metaros.Node("robot", context=here, parameter_file=path, parameter_overrides=overrides) as node:
        assert node.declare_parameter("speed", 0.5) == 1.0
        assert node.declare_parameter("name", "code") == "program"
        assert "other" not in node.parameters
    path.write_text("nonsense")
    with pytest.raises(ConfigError, match=r"robot\.yaml"):
        metaros.Node("robot", context=here, parameter_file=path)
    wait_until(lambda: not here.graph.nodes())


def test_a_node_without_the_services_keeps_parameters_to_itself(here):
    with metaros.Node("quiet", context=here, enable_parameters=False, allow_undeclared_parameters=True) as node:
        node.parameters["a"] = 1
        assert node.parameters.values() == {"use_sim_time": False, "a": 1}
        assert {endpoint.topic for endpoint in here.graph.endpoints()} == {"/rosout"}


def test_parameters_outlive_their_node(here):
    with metaros.Node("robot", context=here) as node:
        node.declare_parameter("a", 1)
    node.parameters["a"] = 2
    assert node.parameters["a"] == 2
    with pytest.raises(ParameterError):
        node.parameters["a"] = "x"


def test_sets_from_many_threads_are_checked_one_at_a_time(here):
    with metaros.Node("robot", context=here) as node:
        node.declare_parameter("low", 0)
        node.declare_parameter("high", 0)
        node.parameters.add_on_set_callback(lambda values: values["low"] == values["high"])

        def work(number: int) -> None:
            for step in range(50):
                node.parameters.set_atomically({"low": number + step, "high": number + step})

        threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert node.parameters["low"] == node.parameters["high"]


def test_a_file_chooses_the_clock_and_a_running_node_keeps_it(here, tmp_path):
    path = tmp_path / "all.yaml"
    path.write_text("/**: {ros__parameters: {use_sim_time: true}}")
    with metaros.Node("robot", context=here, parameter_file=path) as node:
        assert node.parameters["use_sim_time"] is True
        assert node.clock is not here.clock
        node.parameters["use_sim_time"] = True
        with pytest.raises(ParameterError, match="chosen when the node is made"):
            node.parameters["use_sim_time"] = False
    path.write_text("/**: {ros__parameters: {use_sim_time: 1}}")
    with pytest.raises(ParameterError, match="use_sim_time: override: wrong type"):
        metaros.Node("robot", context=here, parameter_file=path)
