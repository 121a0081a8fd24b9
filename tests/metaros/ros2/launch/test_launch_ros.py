"""Nodes of launch files: the command that is started for each."""

from __future__ import annotations

import os
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml

from metaros.clock import SystemClock
from metaros.ros2.launch import LaunchContext, LaunchDescription, LaunchService
from metaros.ros2.launch.actions import (
    EmitEvent,
    GroupAction,
    OpaqueFunction,
    SetLaunchConfiguration,
    Shutdown,
    TimerAction,
)
from metaros.ros2.launch.substitutions import LaunchConfiguration, SubstitutionFailure
from metaros.ros2.launch_ros.actions import (
    ComposableNodeContainer,
    LifecycleNode,
    Node,
    PushRosNamespace,
    SetParameter,
    SetParametersFromFile,
    SetRemap,
)
from metaros.ros2.launch_ros.descriptions import ParameterFile, ParameterValue
from metaros.ros2.launch_ros.events.lifecycle import ChangeState
from metaros.ros2.launch_ros.lifecycle import follow
from metaros.ros2.launch_ros.substitutions import ExecutableInPackage


@pytest.fixture(autouse=True)
def own_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Launches change it."""
    monkeypatch.setattr(os, "environ", os.environ.copy())
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))


def words(*entities: Any) -> tuple[list[list[str]], list[str]]:
    """What the nodes of a launch would be started with, and the lines that were said."""
    lines: list[str] = []
    commands: list[list[str]] = []
    service = LaunchService(out=lines.append)
    service.include_launch_description(LaunchDescription(entities))
    original = Node.execute
    Node.execute = lambda self, context: commands.append(self.words(context))  # type: ignore[method-assign]
    try:
        assert service.run() == 0, lines
    finally:
        Node.execute = original  # type: ignore[method-assign]
    return commands, lines


def test_names_namespaces_remappings_and_arguments(tmp_path: Path) -> None:
    program = tmp_path / "talker.py"
    program.touch()
    commands, _ = words(
        Node(
            executable=str(program),
            name="voice",
            namespace="r1",
            arguments=["-x"],
            ros_arguments=["--log-level", "debug"],
        ),
        GroupAction(
            [
                PushRosNamespace("fleet"),
                PushRosNamespace("west"),
                SetRemap("/tf", "tf"),
                Node(executable=str(program), remappings=[("chatter", "talk")]),
                Node(executable=str(program), namespace="/own"),
            ]
        ),
        Node(executable="/bin/echo"),
    )
    start = [sys.executable, "-m", "metaros.ros2", str(program)]
    west = ["-r", "/tf:=tf"]
    assert commands == [
        [*start, "-x", "--ros-args", "--log-level", "debug", "-r", "__node:=voice", "-r", "__ns:=/r1"],
        [*start, "--ros-args", "-r", "__ns:=/fleet/west", *west, "-r", "chatter:=talk"],
        [*start, "--ros-args", "-r", "__ns:=/own", *west],
        ["/bin/echo", "--ros-args"],
    ]


def test_parameters_come_in_files_in_their_order(tmp_path: Path) -> None:
    given = tmp_path / "given.yaml"
    given.write_text("/**:\n  ros__parameters:\n    place: $(var place)\n")
    commands, _ = words(
        SetLaunchConfiguration("place", "hall"),
        SetLaunchConfiguration("speed", "1.5"),
        SetParameter("use_sim_time", True),
        SetParametersFromFile(str(given)),
        Node(
            executable="/bin/echo",
            parameters=[
                {"speed": LaunchConfiguration("speed"), "inner": {"list": [1, 2]}},
                {"text": ParameterValue(LaunchConfiguration("speed"), value_type=str)},
                str(given),
                ParameterFile(str(given), allow_substs=True),
                {"last": ["a", LaunchConfiguration("place")]},
            ],
        ),
    )
    (command,) = commands
    files = [word for flag, word in pairwise(command) if flag == "--params-file"]
    found = [yaml.safe_load(Path(name).read_text())["/**"]["ros__parameters"] for name in files]
    assert found == [
        {"use_sim_time": True},
        {"place": "$(var place)"},
        {"speed": 1.5, "inner.list": [1, 2], "text": "1.5"},
        {"place": "$(var place)"},
        {"place": "hall"},
        {"last": "ahall"},
    ]


def test_an_executable_of_a_package_and_what_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    binary, script = tmp_path / "lib" / "pkg" / "run_it", tmp_path / "lib" / "pkg" / "script"
    binary.parent.mkdir(parents=True)
    for path, text in ((binary, b"\x7fELF"), (script, b"#!/usr/bin/env python3\n")):
        path.write_bytes(text)
        path.chmod(0o755)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    commands, lines = words(
        Node(package="pkg", executable="run_it"),
        Node(executable=ExecutableInPackage("run_it", "pkg")),
        Node(package="pkg", executable="script", prefix="nice -n 5"),
        ComposableNodeContainer(name="c", namespace="", package="rclcpp_components", executable="component_container"),
    )
    assert commands == [
        *[[str(binary), "--ros-args"]] * 2,
        ["nice", "-n", "5", sys.executable, "-m", "metaros", "ros2", "run", "pkg", "script", "--ros-args"],
    ]
    assert any("ComposableNodeContainer" in line for line in lines)
    with pytest.raises(SubstitutionFailure, match="pkg"):
        ExecutableInPackage("nobody", "pkg").perform(LaunchContext())


def test_a_lifecycle_node_that_never_comes_does_not_hold_up_the_end(
    ros2_router: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("METAROS_ZENOH_PORT", ros2_router)
    ghost = LifecycleNode(name="ghost", namespace="/launched", executable="none")
    asked = EmitEvent(event=ChangeState(lifecycle_node_matcher=lambda action: action is ghost, transition_id=1))
    lines: list[str] = []
    service = LaunchService(out=lines.append)
    service.include_launch_description(
        LaunchDescription(
            [
                OpaqueFunction(function=lambda context: follow(ghost, context, autostart=False)),
                asked,
                TimerAction(period=0.1, actions=[Shutdown(reason="enough")]),
            ]
        )
    )
    begun_s = SystemClock.monotonic_s()
    assert (service.run(), lines) == (0, [])
    assert SystemClock.monotonic_s() - begun_s < 30.0  # of the 60 that it waits for the node
