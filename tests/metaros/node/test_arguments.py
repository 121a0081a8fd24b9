"""`--ros-args`: read as ROS 2 reads them, and obeyed by nodes."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import metaros
from metaros.errors import ConfigError
from metaros.node.arguments import parse_ros_args, without_ros_args


def words(text: str) -> list[str]:
    return ["program", *text.split()]


def test_names_remappings_and_parameters() -> None:
    line = "--ros-args -r __node:=voice -r __ns:=/robot -r chatter:=talk -r ~/state:=/s -p rate:=2.5 -p on:=true"
    node = parse_ros_args(words(line)).for_node("talker", "/")
    assert (node.name, node.namespace) == ("voice", "/robot")
    assert node.remaps == {"/robot/chatter": "/robot/talk", "/robot/voice/state": "/s"}
    assert node.parameters == {"rate": 2.5, "on": True}
    assert node.remapped("/other") == "/other"


def test_a_rule_for_one_node_is_not_for_another() -> None:
    args = parse_ros_args(words("--ros-args -r a:chatter:=talk -p a:rate:=1 -r b:__node:=c"))
    assert args.for_node("a", "/").remaps == {"/chatter": "/talk"}
    assert args.for_node("a", "/").parameters == {"rate": 1}
    assert args.for_node("b", "/").name == "c"
    assert args.for_node("b", "/").remaps == {}
    assert args.for_node("b", "/").parameters == {}


def test_the_first_rule_for_a_name_counts_and_the_last_value_of_a_parameter() -> None:
    node = parse_ros_args(words("--ros-args -r a:=b -r a:=c -p k:=1 -p k:=2")).for_node("n", "/")
    assert node.remaps == {"/a": "/b"}
    assert node.parameters == {"k": 2}


def test_rules_for_topics_or_services_alone() -> None:
    line = "--ros-args -r rostopic://a:=b -r n:rosservice://a:=c -r m:rostopic://a:=d -r x:=y -r rosservice://x:=z"
    node = parse_ros_args(words(line)).for_node("n", "/")
    assert node.remaps == {"/a": "/b", "/x": "/y"}
    assert node.service_remaps == {"/a": "/c", "/x": "/y"}
    assert (node.remapped("/a"), node.remapped("/a", service=True)) == ("/b", "/c")


def test_levels_by_logger_enclave_and_what_is_switched_off() -> None:
    line = (
        "--ros-args --log-level warn --log-level r.talker:=debug --log-level r:=error --enclave /lab/arm "
        "--disable-rosout-logs --disable-stdout-logs --enable-stdout-logs --log-config-file f --log-file-name g"
    )
    args = parse_ros_args(words(line))
    found = {(name, space): args.for_node(name, space).log_level for name in ("talker", "x") for space in ("/r", "/q")}
    assert found == {("talker", "/r"): "DEBUG", ("x", "/r"): "ERROR", ("talker", "/q"): "WARN", ("x", "/q"): "WARN"}
    assert args.level_of("r.talker.child") == "DEBUG"
    node = args.for_node("x", "/")
    assert (node.enclave, node.rosout_logs, node.stdout_logs) == ("/lab/arm", False, True)


def test_files_and_values_in_the_order_given(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("/**:\n  ros__parameters: {k: 1, other: x}\n")
    after = parse_ros_args(words(f"--ros-args -p k:=2 --params-file {path}")).for_node("n", "/")
    before = parse_ros_args(words(f"--ros-args --params-file {path} -p k:=2")).for_node("n", "/")
    assert after.parameters == {"k": 1, "other": "x"}
    assert before.parameters == {"k": 2, "other": "x"}


def test_the_rest_of_the_command_line() -> None:
    argv = words("--count 3 --ros-args -p a:=1 -- --more")
    assert without_ros_args(argv) == words("--count 3 --more")
    assert parse_ros_args(argv).parameters[0].name == "a"


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("-r", "-r needs a value"),
        ("-r a=b", "name:=value"),
        ("-r :a:=b", "name:=value"),
        ("-r __node:=a/b", "__node:=a/b"),
        ("-r __what:=a", "__node, __name and __ns"),
        ("-r a:=b!", "a:=b!"),
        ("-p :=1", "name:=value"),
        ("--log-level loud", "DEBUG"),
        ("--log-level :=info", "logger:=LEVEL"),
        ("-e a!b", "--enclave 'a!b'"),
        ("-r rostopic://:=b", "name:=value"),
        ("--unheard-of", "--unheard-of"),
    ],
)
def test_what_cannot_be_read_is_named(line: str, named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        parse_ros_args(words(f"--ros-args {line}"))


def test_a_node_obeys_the_command_line(monkeypatch: pytest.MonkeyPatch) -> None:
    line = "--ros-args -r __node:=voice -r __ns:=/r -r chatter:=talk -p rate:=2 --log-level warn"
    monkeypatch.setattr(sys, "argv", words(line))
    from metaros.interfaces.std_msgs.msg import String

    with metaros.Context(connect=[]) as context, metaros.Node("talker", context=context) as node:
        assert node.full_name == "/r/voice"
        assert node.create_publisher(String, "chatter").topic == "/r/talk"
        assert node.create_subscription(String, "/r/chatter", lambda message: None).topic == "/r/talk"
        assert node.declare_parameter("rate", 1) == 2
        assert node.get_logger().level == 30


def test_a_node_is_in_its_enclave_and_says_nothing_where_that_was_asked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from metaros.interfaces.std_srvs.srv import Trigger

    line = "--ros-args -e lab --disable-stdout-logs --disable-rosout-logs -r rosservice://do:=done"
    monkeypatch.setattr(sys, "argv", words(line))
    with metaros.Context(connect=[]) as context, metaros.Node("talker", context=context) as node:
        node.get_logger().info("not seen")
        assert node.token.enclave == "/lab"
        assert "%lab" in str(node.token)
        assert context.graph.endpoints("/rosout", "MP") == []
        assert node.create_client(Trigger, "do").topic == "/done"
    assert capsys.readouterr().err == ""


def test_what_a_program_passes_wins_over_the_command_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", words("--ros-args -p rate:=2"))
    with metaros.Context(connect=[]) as context:
        with metaros.Node("n", context=context, parameter_overrides={"rate": 3}) as node:
            assert node.declare_parameter("rate", 1) == 3
