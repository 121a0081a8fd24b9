"""The kit's way with an installation of ROS 2, tried on a stand-in; and ROS 2's own demos, where ROS 2 is."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.ros2.cast import OURS, ROS, Cast
from tests.ros2.installation.commands import Installation
from tests.ros2.installation.stand_in import make_stand_in
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[2]
TEXT = "std_msgs/msg/String"
SOME = "ros-to-native or (native-to-ros and (arrives or kept or goals or states))"


@pytest.mark.integration
def test_scenarios_are_played_with_an_installation_and_told_in_a_table(tmp_path: Path) -> None:
    """As `make conformance ROS=folder` does. The stand-in is our own rclpy: it tries the kit, not ROS 2."""
    folder = make_stand_in(tmp_path / "jazzy")
    environment = {**os.environ, "METAROS_ROS": str(folder), "METAROS_CONFORMANCE": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-k", SOME, "tests/ros2"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = re.findall(r"^(.+?)  +(us|peer) +(.*)$", done.stdout, re.MULTILINE)
    played = {(title.strip(), told_by): re.split(r"  +", cells)[-1] for title, told_by, cells in rows}
    assert len(played) >= 28
    assert [row for row, cell in played.items() if row[1] == "peer" and cell not in ("passed 1", "[7]")] == []
    assert played["services", "us"] == "not run"
    assert played["lifecycle nodes", "us"] == "passed 1"


def test_a_folder_without_ros_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="ROS= is the folder of an installation"):
        Installation(tmp_path, "tcp/127.0.0.1:7447", tmp_path)


if ROS:
    # Not collected elsewhere: nobody is told of what was never meant to run.

    @pytest.mark.parametrize("package", ["demo_nodes_py", "demo_nodes_cpp"])
    @pytest.mark.parametrize("ours", [part.name for part in OURS])
    def test_demos_of_ros2_are_heard_and_hear(cast: Cast, ours: str, package: str) -> None:
        """`talker` and `listener` of rclpy and of rclcpp, each under a name of its own."""
        side: Any = cast[ours]
        topic = f"/{ours}_{package}_chatter"
        arguments = ["--ros-args", "-r", f"chatter:={topic}"]
        talker = cast["ros"].ros.start("ros2", "run", package, "talker", *arguments)
        try:
            with side.lending():
                heard = side.listen(topic, TEXT)
                wait_until(lambda: any(re.fullmatch(r"Hello World: \d+", message["data"]) for message in heard()))
        finally:
            talker.stop()
        listener = cast["ros"].ros.start("ros2", "run", package, "listener", *arguments)
        try:
            with side.lending():
                say = side.speak(topic, TEXT, {"data": "from afar"})
                wait_until(lambda: (say() and False) or "I heard: [from afar]" in listener.text(), every_s=0.1)
        finally:
            listener.stop()
