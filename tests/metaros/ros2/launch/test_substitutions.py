"""Texts that are known when a launch file runs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from metaros.ros2.launch import LaunchContext
from metaros.ros2.launch.conditions import (
    IfCondition,
    InvalidConditionExpressionError,
    LaunchConfigurationEquals,
    LaunchConfigurationNotEquals,
    UnlessCondition,
)
from metaros.ros2.launch.substitution import Substitution, perform_substitutions
from metaros.ros2.launch.substitutions import (
    AndSubstitution,
    AnonName,
    Command,
    EnvironmentVariable,
    EqualsSubstitution,
    FileContent,
    FindExecutable,
    IfElseSubstitution,
    LaunchConfiguration,
    LocalSubstitution,
    NotEqualsSubstitution,
    NotSubstitution,
    OrSubstitution,
    PathJoinSubstitution,
    PathSubstitution,
    PythonExpression,
    SubstitutionFailure,
    TextSubstitution,
    ThisLaunchFile,
    ThisLaunchFileDir,
)


@pytest.fixture
def context() -> LaunchContext:
    """With a configuration or two, in a file."""
    made = LaunchContext()
    made.launch_configurations |= {"robot": "r1", "sim": "true"}
    made.locals.current_launch_file_path = "/ws/launch/a.launch.py"
    made.locals.current_launch_file_directory = "/ws/launch"
    return made


def test_texts(context: LaunchContext, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLACE", "hall")
    (tmp_path / "note").write_text("hello")
    robot = LaunchConfiguration("robot")
    table: list[tuple[Substitution, str]] = [
        (TextSubstitution(text="a"), "a"),
        (robot, "r1"),
        (LaunchConfiguration("nobody", default=["x", robot]), "xr1"),
        (EnvironmentVariable("PLACE"), "hall"),
        (EnvironmentVariable("NO_SUCH", default_value="none"), "none"),
        (PathJoinSubstitution([ThisLaunchFileDir(), "maps", [robot, ".yaml"]]), "/ws/launch/maps/r1.yaml"),
        (PathSubstitution("/a") / "b" / robot, "/a/b/r1"),
        (ThisLaunchFile(), "/ws/launch/a.launch.py"),
        (PythonExpression(["'", robot, "' == 'r1' and pi > 3"]), "True"),
        (Command(["echo ", robot]), "r1\n"),
        (FindExecutable(name="python3"), sys.executable),
        (FileContent(str(tmp_path / "note")), "hello"),
        (NotSubstitution("false"), "true"),
        (AndSubstitution("true", LaunchConfiguration("sim")), "true"),
        (OrSubstitution("0", "False"), "false"),
        (EqualsSubstitution(robot, "r1"), "true"),
        (EqualsSubstitution("1", 1.0), "true"),
        (NotEqualsSubstitution(True, LaunchConfiguration("sim")), "false"),
        (IfElseSubstitution(LaunchConfiguration("sim"), "a", "b"), "a"),
        (LocalSubstitution("current_launch_file_path"), "/ws/launch/a.launch.py"),
    ]
    assert [(type(item), item.perform(context)) for item, _ in table] == [(type(item), text) for item, text in table]
    assert perform_substitutions(context, ["a-", robot, Path("/b")]) == "a-r1/b"
    anonymous = AnonName("n").perform(context)
    assert anonymous.startswith("n_")
    assert anonymous == AnonName("n").perform(context)


def test_what_has_no_text_says_why(context: LaunchContext) -> None:
    for item, word in (
        (LaunchConfiguration("nobody"), "nobody"),
        (EnvironmentVariable("NO_SUCH_VARIABLE"), "NO_SUCH_VARIABLE"),
        (FindExecutable(name="no-such-program"), "no-such-program"),
        (Command("false"), "ended with 1"),
        (FileContent("/no/such"), "/no/such"),
        (LocalSubstitution("event.returncode"), "event.returncode"),
    ):
        with pytest.raises(SubstitutionFailure, match=word):
            item.perform(context)
    with pytest.raises(SubstitutionFailure, match="no launch file"):
        ThisLaunchFileDir().perform(LaunchContext())
    with pytest.raises(TypeError, match="no text"):
        perform_substitutions(context, 5)  # type: ignore[arg-type]


def test_conditions(context: LaunchContext) -> None:
    table = [
        (IfCondition("TRUE"), True),
        (IfCondition(LaunchConfiguration("sim")), True),
        (UnlessCondition("1"), False),
        (LaunchConfigurationEquals("robot", "r1"), True),
        (LaunchConfigurationEquals("nobody", None), True),
        (LaunchConfigurationNotEquals("robot", "r2"), True),
    ]
    assert [condition.evaluate(context) for condition, _ in table] == [expected for _, expected in table]
    with pytest.raises(InvalidConditionExpressionError, match="maybe"):
        IfCondition("maybe").evaluate(context)
