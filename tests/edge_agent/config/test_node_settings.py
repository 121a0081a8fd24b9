"""What may run on a robot is the robot's own word."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from edge_agent.config.node_settings import NodeSettings, allowed_entries
from edge_agent.config.settings import load_settings
from edge_agent.nodes.errors import NodeRefusedError
from edge_agent.nodes.launch_row import LaunchContext, as_json, launch_row
from metaros.errors import ConfigError
from metaros.fleet.twin import parse
from metaros.fleet.twin.document import NodeSpec
from metaros.supervise.node_table_file import read_rows

PLACE = LaunchContext(namespace="/r1", zenoh_port=7447, python="/py")


def wanted(**row: Any) -> NodeSpec:
    nodes = parse({"nodes": {"n": row}}).nodes
    assert nodes is not None
    return nodes["n"]


def settings(*rows: dict[str, Any], **values: Any) -> NodeSettings:
    return NodeSettings(allowed=allowed_entries(list(rows), "f"), **values)


def test_it_comes_from_the_agents_file(tmp_path: Path) -> None:
    path = tmp_path / "agent.toml"
    path.write_text('[nodes]\nfree_commands = true\nhealth_s = 5\n[[allowed]]\nname = "l"\ncommand = ["l", "-v"]\n')
    found = load_settings(path).nodes
    assert found.free_commands
    assert found.health_s == 5
    assert found.allowed["l"].command == ("l", "-v")
    assert load_settings(None).nodes == NodeSettings()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[nodes]\nfree_commands = 1", "free_commands"),
        ("[nodes]\nfree = true", r"nodes\.free"),
        ("[nodes]\nhealth_s = 0", "health_s"),
        ('[nodes]\nsafe_stop = "x"', "safe_stop: expected a program"),
        ('[nodes]\nsafe_stop_service = "a b"', "safe_stop_service"),
        ('[nodes]\nsafe_stop_publish = {cmd_vel = "Twist"}', "safe_stop_publish"),
        ('[nodes]\nsafe_stop_publish = {"cmd vel" = "a/msg/B"}', "safe_stop_publish"),
        ('[nodes]\nfunction_actuators = "**/cmd_vel"', "function_actuators: expected patterns"),
        ('[nodes]\nfunction_actuators = ["a b"]', "function_actuators"),
        ("allowed = 3", "allowed"),
        ('[[allowed]]\nname = "a"', "exactly one"),
        ('[[allowed]]\nname = "a"\ncommand = ["x"]\nmodule = "y"', "exactly one"),
        ('[[allowed]]\nname = "a b"\ncommand = ["x"]', "name"),
        ('[[allowed]]\nname = "a"\ncommand = "x"', "command"),
        ('[[allowed]]\nname = "a"\ncommand = []', "command"),
        ('[[allowed]]\nname = "a"\nclass = "x"', "class"),
        ('[[allowed]]\nname = "a"\nmodule = "x:y"', "module"),
        ('[[allowed]]\nname = "a"\ncommand = ["x"]\nargs = ["y"]', "args"),
        ('[[allowed]]\nname = "a"\ncommand = ["x"]\nenv = {A = 1}', "env"),
        ('[[allowed]]\nname = "a"\ncommand = ["x"]\ncolour = 1', "colour"),
        ('[[allowed]]\nname = "a"\ncommand = ["x"]\n[[allowed]]\nname = "a"\ncommand = ["x"]', "already"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "agent.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said):
        load_settings(path)


def test_an_entry_runs_as_the_robot_wrote_it() -> None:
    row = launch_row(
        wanted(allowed="l"), settings({"name": "l", "command": ["/bin/l", "-v"], "env": {"A": "1"}}), PLACE
    )
    assert row.argv == ("/bin/l", "-v")
    assert row.env["A"] == "1"
    assert row.env["METAROS_ZENOH_PORT"] == "7447"


def test_a_module_gets_name_namespace_and_parameters() -> None:
    row = launch_row(
        wanted(allowed="m", parameters={"rate_hz": 5.0}), settings({"name": "m", "module": "my.node"}), PLACE
    )
    ros = ("--ros-args", "-r", "__node:=n", "-r", "__ns:=/r1", "-p", "rate_hz:=5.0")
    assert row.argv == ("/py", "-m", "metaros.cli.launch_child", "module", "my.node", *ros)
    assert row.own_guard


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ({"command": ["sh", "-c", "x"]}, "no free commands"),
        ({"allowed": "other"}, "'other' is not in this robot's"),
        ({"allowed": "l", "args": ["-c", "x"]}, "no arguments"),
        ({"allowed": "l", "parameters": {"a": 1}}, "no parameters"),
        ({"bundle": "b", "version": "1.0"}, "is not here"),
    ],
)
def test_everything_else_is_refused_by_name(row: dict[str, Any], said: str) -> None:
    with pytest.raises(NodeRefusedError, match=said):
        launch_row(wanted(**row), settings({"name": "l", "command": ["l"]}), PLACE)


def test_what_the_robot_opens_is_open() -> None:
    free = settings({"name": "l", "command": ["l"], "args": True, "parameters": True}, free_commands=True)
    assert launch_row(wanted(command=["sh", "-c", "x"]), free, PLACE).argv == ("sh", "-c", "x")
    row = launch_row(wanted(allowed="l", args=["-x"], parameters={"a": "ü"}), free, PLACE)
    assert row.argv == ("l", "-x", "--ros-args", "-r", "__ns:=/r1", "-p", 'a:="ü"')


def test_a_critical_node_knows_how_the_robot_comes_to_rest(tmp_path: Path) -> None:
    path = tmp_path / "agent.toml"
    path.write_text(
        '[nodes]\nsafe_stop = ["/bin/estop", "-v"]\nsafe_stop_service = "base/stop"\n'
        'safe_stop_publish = {cmd_vel = "geometry_msgs/msg/Twist"}\n'
        '[[allowed]]\nname = "l"\ncommand = ["l"]\n'
    )
    found, guarded = (
        load_settings(path).nodes,
        LaunchContext(namespace="/", zenoh_port=1, python="/py", drive_session="/s.json5"),
    )
    program = ("/py", "-m", "metaros.cli.safe_stop")
    ways = ("--publish=cmd_vel=geometry_msgs/msg/Twist", "--call=base/stop", "--", "/bin/estop", "-v")
    row = launch_row(wanted(allowed="l", critical=True), found, PLACE)
    assert row.safe_stop == (*program, "--namespace=/r1", *ways)
    row = launch_row(wanted(allowed="l", critical=True), found, guarded)
    assert row.safe_stop == (*program, "--namespace=/", "--session=/s.json5", *ways)
    assert launch_row(wanted(allowed="l"), found, PLACE).safe_stop == ()
    assert (
        launch_row(wanted(allowed="l", critical=True), settings({"name": "l", "command": ["l"]}), PLACE).safe_stop == ()
    )


def test_every_row_is_one_that_the_supervisor_takes() -> None:
    node = wanted(allowed="l", restart="on-failure", critical=True, nice=3, migratable=True, run=False)
    row = launch_row(node, settings({"name": "l", "command": ["l"]}), PLACE)
    assert read_rows([as_json(row)]) == (row,)
    assert (row.restart, row.critical, row.nice, row.migratable, row.run) == ("on-failure", True, 3, True, False)


LIDAR = {"name": "lidar", "driver": "ld19", "fixed": {"port": "/dev/ttyUSB0"}}


def test_a_driver_runs_with_what_the_robot_fixes_and_what_comes_from_afar() -> None:
    row = launch_row(wanted(allowed="lidar", parameters={"bins": 100}), settings(LIDAR), PLACE)
    assert row.argv[:5] == ("/py", "-m", "metaros.cli.launch_child", "driver", "ld19")
    assert row.argv[-4:] == ("-p", "bins:=100", "-p", 'port:="/dev/ttyUSB0"')
    assert row.own_guard


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"port": "/dev/other"}, "port is set on the robot only"),
        ({"allow_faults": True}, "allow_faults is set on the robot only"),
        ({"bins": 1}, "must be 36 to 3600"),
        ({"bin": 100}, "did you mean 'bins'"),
    ],
)
def test_what_a_driver_opens_is_not_chosen_from_afar(parameters: dict[str, Any], said: str) -> None:
    for entry in (LIDAR, {**LIDAR, "fixed": {}}):
        with pytest.raises(NodeRefusedError, match=said):
            launch_row(wanted(allowed="lidar", parameters=parameters), settings(entry), PLACE)


def test_what_the_robot_fixes_stays() -> None:
    with pytest.raises(NodeRefusedError, match="bins is set on the robot only"):
        launch_row(
            wanted(allowed="lidar", parameters={"bins": 100}), settings({**LIDAR, "fixed": {"bins": 450}}), PLACE
        )


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ({"driver": "toaster"}, "driver: no driver 'toaster'"),
        ({"driver": "ld19", "args": True}, "args: a driver takes none"),
        ({"driver": 3}, "driver: expected a kind"),
        ({"driver": "ld19", "fixed": {"bins": 1}}, "fixed: ld19: bins must be"),
        ({"driver": "ld19", "fixed": 3}, "fixed: expected a table"),
        ({"module": "x", "fixed": {"a": 1}}, "fixed: expected a table of a driver"),
    ],
)
def test_a_drivers_entry_is_checked(row: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        allowed_entries([{"name": "a", **row}], "f")
