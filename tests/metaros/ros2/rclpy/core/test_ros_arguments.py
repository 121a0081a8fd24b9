"""What a context's command line and a node's own arguments say together."""

from __future__ import annotations

import pytest

from metaros.ros2.rclpy.core.rcl_errors import UnknownROSArgsError
from metaros.ros2.rclpy.core.ros_arguments import node_arguments, parse_arguments


def test_the_nodes_own_arguments_win() -> None:
    of_context = parse_arguments(
        ["p", "--ros-args", "-r", "__node:=one", "-r", "a:=b", "-r", "c:=d", "-p", "x:=1", "-p", "y:=2"]
    )
    of_node = parse_arguments(["--ros-args", "-r", "__ns:=/own", "-r", "a:=z", "-p", "y:=3"], implied=True)
    both = node_arguments("given", "/", of_context=of_context, of_node=of_node)
    assert (both.name, both.namespace) == ("one", "/own")
    assert both.remaps == {"/own/a": "/own/z", "/own/c": "/own/d"}
    assert both.parameters == {"x": 1, "y": 3}
    alone = node_arguments("given", "/", of_context=None, of_node=of_node)
    assert (alone.name, alone.parameters) == ("given", {"y": 3})
    nothing = node_arguments("given", "/ns", of_context=None, of_node=None)
    assert (nothing.full_name, nothing.remaps, nothing.parameters) == ("/ns/given", {}, {})


def test_a_nodes_arguments_need_no_flag_before_them() -> None:
    found = parse_arguments(["-r", "__ns:=/own"], implied=True)
    assert found == parse_arguments(["--ros-args", "-r", "__ns:=/own"], implied=True)
    with pytest.raises(UnknownROSArgsError, match="--what"):
        parse_arguments(["--what"], implied=True)
    assert not parse_arguments(["--what"]).remaps


def test_without_arguments_it_is_the_programs_command_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["p", "--ros-args", "-r", "a:=b"])
    assert parse_arguments(None).remaps == parse_arguments(["p", "--ros-args", "-r", "a:=b"]).remaps != ()
