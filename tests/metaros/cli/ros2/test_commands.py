"""`metaros ros2`: programs run here as they would by themselves."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from metaros.ros2 import uninstall
from tests.support.processes.command_line import call_metaros
from tests.support.processes.processes import END_S, started


@pytest.fixture(autouse=True)
def as_before(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What a program changes in this process is put back."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
    before = set(sys.modules)
    yield
    uninstall()
    for name in set(sys.modules) - before:
        if name.partition(".")[0] in ("my_robot", "beside"):
            del sys.modules[name]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A program that says what it sees, one that fails, and a package in source."""
    (tmp_path / "beside.py").write_text("value = 7\n")
    (tmp_path / "show.py").write_text(
        "import os, sys, json, beside, rclpy\n"
        "if __name__ == '__main__':\n"
        "    print(json.dumps([sys.argv, beside.value, rclpy.__name__, os.environ['ROS_DISTRO'], sys.path[0]]))\n"
        "    sys.exit(int(sys.argv[1]))\n"
    )
    (tmp_path / "fail.py").write_text("def go():\n    raise EOFError('no more')\ngo()\n")
    (tmp_path / "stop.py").write_text("raise KeyboardInterrupt\n")
    robot = tmp_path / "ws" / "my_robot"
    (robot / "my_robot").mkdir(parents=True)
    (robot / "package.xml").write_text("<package><name>my_robot</name></package>")
    (robot / "setup.py").write_text(
        "setup(entry_points={'console_scripts': ['go = my_robot.go:main', 'idle = my_robot.go:idle']})"
    )
    (robot / "my_robot" / "go.py").write_text(
        "import sys\ndef main():\n    print(sys.argv)\n    return 3\ndef idle(): pass\n"
    )
    return tmp_path


def test_a_file_runs_as_main_with_its_arguments_and_its_folder(folder: Path) -> None:
    done = call_metaros("ros2", "run", str(folder / "show.py"), "5", "-x", "--", "--ros-args", "-r", "a:=b")
    assert (done.code, done.err) == (5, "")
    argv = [str(folder / "show.py"), "5", "-x", "--", "--ros-args", "-r", "a:=b"]
    assert json.loads(done.out) == [argv, 7, "metaros.ros2.rclpy", "jazzy", str(folder)]


def test_an_error_of_the_program_is_shown_as_python_shows_it(folder: Path) -> None:
    done = call_metaros("ros2", "run", str(folder / "fail.py"))
    assert done.code == 1
    assert done.err.startswith(f'Traceback (most recent call last):\n  File "{folder / "fail.py"}", line 3')
    assert done.err.endswith("EOFError: no more\n")
    assert call_metaros("ros2", "run", str(folder / "stop.py")) == (130, "", "")
    for line, advised in (("from nav2_msgs.action import Spin", True), ("import nowhere", False)):
        (folder / "fail.py").write_text(f"{line}\n")
        done = call_metaros("ros2", "run", str(folder / "fail.py"))
        assert ("METAROS_INTERFACE_PATH names folders that hold nav2_msgs/msg" in done.err) is advised


def test_an_executable_of_a_package_that_nobody_has_built(folder: Path) -> None:
    done = call_metaros("ros2", "run", "--package-path", str(folder / "ws"), "my_robot", "go", "--ros-args")
    assert done == (3, "['go', '--ros-args']\n", "")
    assert call_metaros("ros2", "run", "my_robot", "idle", folder=folder) == (0, "", "")
    own = "tf2_ros static_transform_publisher\n"
    assert call_metaros("ros2", "list", folder=folder).out == f"my_robot go\nmy_robot idle\n{own}"
    rows = json.loads(call_metaros("ros2", "list", "my_robot", "-o", "json", folder=folder).out)
    assert [row["executable"] for row in rows] == ["go", "idle"]
    assert call_metaros("ros2", "list", "your_robot", folder=folder).code == 2


def test_what_has_no_effect_and_what_is_not_there_is_said(folder: Path) -> None:
    done = call_metaros("ros2", "run", "my_robot", "iddle", folder=folder)
    assert (done.code, done.err) == (2, "error: package my_robot has no executable 'iddle'; did you mean idle?\n")
    done = call_metaros("ros2", "run", "my_robot", "idle", folder=folder, RMW_IMPLEMENTATION="rmw_cyclonedds_cpp")
    assert "RMW_IMPLEMENTATION=rmw_cyclonedds_cpp has no effect" in done.err


def test_by_python_and_ctrl_c(folder: Path) -> None:
    (folder / "wait.py").write_text("import sys, signal\nprint(sys.path[0], flush=True)\nsignal.pause()\n")
    command = [sys.executable, "-m", "metaros.ros2", "wait.py"]
    with started(command, cwd=folder) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"{folder}\n"
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=END_S) == ("", "")
    assert process.returncode == 130


def test_a_launch_file_its_arguments_and_what_is_none(tmp_path: Path) -> None:
    file = tmp_path / "hello.launch.py"
    file.write_text(
        "from launch import LaunchDescription\n"
        "from launch.actions import DeclareLaunchArgument, LogInfo\n"
        "from launch.substitutions import LaunchConfiguration\n"
        "def generate_launch_description():\n"
        "    who = DeclareLaunchArgument('who', default_value='world', description='whom to greet')\n"
        "    return LaunchDescription([who, LogInfo(msg=['hello ', LaunchConfiguration('who')])])\n"
    )
    done = call_metaros("ros2", "launch", str(file), "who:=you")
    assert (done.code, done.out) == (0, "[INFO] [launch.user]: hello you\n")
    shown = call_metaros("ros2", "launch", "-s", str(file))
    assert shown.out == "who:\n    whom to greet\n    default: 'world'\n"
    for words, expected in {
        ("no.launch.py",): "no launch file",
        ("no_package", "a.launch.py"): "no_package",
        ("a", "b", "c"): "PACKAGE and its FILE",
    }.items():
        done = call_metaros("ros2", "launch", *words)
        assert (done.code, expected in done.err) == (2, True), done
