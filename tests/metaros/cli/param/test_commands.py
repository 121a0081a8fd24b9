"""`metaros param` against a real node: what ros2 prints, JSON, refusals and hints."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

import metaros
from tests.metaros.cli.conftest import assert_reported, spinning
from tests.support.processes.command_line import call_metaros, program
from tests.support.processes.processes import END_S, started


@pytest.fixture(scope="module")
def shared_arm(zenoh_router: str, told) -> Iterator[metaros.Node]:
    """A node with parameters of several kinds, spinning."""
    with (
        metaros.Context(connect=zenoh_router) as context,
        metaros.Node("arm", namespace="/demo", context=context) as node,
        metaros.Node("mute", context=context, enable_parameters=False),
    ):
        node.declare_parameter("speed", 0.5, minimum=0.0, maximum=1.0, step=0.1, description="m/s")
        node.declare_parameter("mode", "auto", choices=("auto", "manual"))
        node.declare_parameter("motor.id", 7, read_only=True)
        node.declare_parameter("raw", b"\x01\xff")
        node.declare_parameter("any", 1, dynamic_typing=True)
        node.declare_parameter("late", parameter_type=float, minimum=0.0)
        with spinning(node):
            told("/demo/arm/list_parameters")
            yield node


@pytest.fixture
def arm(shared_arm: metaros.Node) -> metaros.Node:
    """The same, its parameters as at the start."""
    if "any" not in shared_arm.parameters:
        shared_arm.declare_parameter("any", 1, dynamic_typing=True)
    shared_arm.parameters.set_atomically({"speed": 0.5, "mode": "auto", "any": 1})
    return shared_arm


def test_list(run, arm):
    assert run("param", "list").out == "/demo/arm:\n  any\n  late\n  mode\n  motor.id\n  raw\n  speed\n  use_sim_time\n"
    assert run("param", "list", "/demo/arm", "--filter", "^m", "--param-type").out == (
        "mode (type: string)\nmotor.id (type: integer)\n"
    )
    found = json.loads(run("param", "list", "demo/arm", "-o", "json").out)
    assert found["node"] == "/demo/arm"
    assert {"name": "speed", "type": "double"} in found["parameters"]
    assert run("param", "list", "/demo/arm", "--filter", "[").code == 2


def test_get(run, arm):
    assert run("param", "get", "/demo/arm", "speed").out == "Double value is: 0.5\n"
    assert run("param", "get", "/demo/arm", "speed", "--hide-type").out == "0.5\n"
    assert run("param", "get", "/demo/arm", "raw").out == "Byte values are: [b'\\x01', b'\\xff']\n"
    assert run("param", "get", "/demo/arm", "late").out == "Parameter not set.\n"
    found = json.loads(run("param", "get", "/demo/arm", "raw", "-o", "json").out)
    assert found == {"name": "raw", "type": "byte array", "value": [1, 255]}


def test_set_reads_the_value_as_the_parameters_type(run, arm):
    assert run("param", "set", "/demo/arm", "speed", "1").out == "Set parameter successful\n"
    assert arm.parameters["speed"] == 1.0
    assert json.loads(run("param", "set", "/demo/arm", "any", "[a, b]", "-o", "json").out)["value"] == ["a", "b"]
    assert arm.parameters["any"] == ["a", "b"]
    assert run("param", "set", "/demo/arm", "any", "-3").code == 0
    assert arm.parameters["any"] == -3


def test_what_cannot_be_says_why(run, arm):
    table = {
        ("set", "/demo/arm", "speed", "3"): (1, "refused to set speed: 3.0 is not within 0.0..1.0"),
        ("set", "/demo/arm", "speed", "fast"): (2, "speed: wrong type: expected double, got string"),
        ("set", "/demo/arm", "motor.id", "8"): (1, "refused to set motor.id: it is read-only"),
        ("set", "/demo/arm", "sped", "1"): (2, "did you mean speed"),
        ("get", "/demo/arm", "sped"): (2, "has no parameter 'sped'"),
        ("describe", "/demo/arm", "speed", "qqq"): (2, "metaros param list /demo/arm"),
        ("delete", "/demo/arm", "mode"): (1, "statically typed"),
        ("get", "/demo/amr", "speed"): (1, "did you mean /demo/arm"),
        ("dump", "/mute"): (1, "/mute offers no parameters"),
    }
    assert_reported(run, table, "param")


def test_describe(run, arm):
    text = run("param", "describe", "/demo/arm", "speed", "motor.id", "any", "mode").out
    assert "Parameter name: speed\n  Type: double\n  Description: m/s\n  Constraints:\n    Min value: 0.0\n" in text
    assert "    Max value: 1.0\n    Step: 0.1\n" in text
    assert "    Read only: true\n" in text
    assert "    Dynamic typing: true\n" in text
    assert "    Additional constraints: one of auto, manual\n" in text
    (found,) = json.loads(run("param", "describe", "/demo/arm", "speed", "-o", "json").out)
    assert found["range"] == {"from": 0.0, "to": 1.0, "step": 0.1}
    (found,) = json.loads(run("param", "describe", "/demo/arm", "late", "-o", "json").out)
    assert found["range"] == {"from": 0.0, "to": None, "step": 0.0}


def test_dump_and_load_and_delete(run, arm, tmp_path):
    path = tmp_path / "arm.yaml"
    path.write_text(run("param", "dump", "/demo/arm").out.replace("speed: 0.5", "speed: 1"))
    done = run("param", "load", "/demo/arm", str(path))
    assert "Set parameter speed successful\n" in done.out
    assert "Set parameter motor.id failed: motor.id: it is read-only\n" in done.out
    assert done.code == 1
    assert "1 of 6 parameters were refused: motor.id" in done.err
    assert arm.parameters["speed"] == 1.0
    path.write_text("/**: {ros__parameters: {mode: manual}}")
    assert json.loads(run("param", "load", "/demo/arm", str(path), "-o", "json").out) == [
        {"name": "mode", "successful": True, "reason": ""}
    ]
    assert run("param", "load", "/demo/arm", str(path), "--no-use-wildcard").code == 2
    assert run("param", "delete", "/demo/arm", "any").out == "Deleted parameter successfully\n"
    assert "any" not in arm.parameters
    assert json.loads(run("param", "dump", "/demo/arm", "-o", "json").out)["mode"] == "manual"


def test_as_a_process(arm, zenoh_port):
    with started(program("param", "get", "/demo/arm", "mode", "--zenoh-port", zenoh_port)) as process:
        assert process.communicate(timeout=END_S) == ("String value is: auto\n", "")
    assert process.returncode == 0


def test_help_says_what_there_is():
    text = call_metaros("param", "--help").out
    assert all(verb in text for verb in ("list", "get", "set", "describe", "dump", "load", "delete"))
