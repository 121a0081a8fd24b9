"""`metaros ros2 bridge`: it says what it bridges, until Ctrl-C."""

from __future__ import annotations

from tests.metaros.cli.conftest import Run, assert_reported
from tests.support.processes.command_line import stop_metaros


def test_it_bridges_until_asked_to_stop(zenoh_port: str) -> None:
    row = ("--topic", "/talk:=std_msgs/String", "--prefix", "r1")
    done = stop_metaros("ros2", "bridge", *row, "--zenoh-port", zenoh_port, when=lambda text: "← /talk" in text)
    assert (done.code, done.err) == (0, "Ctrl-C stops\n")
    assert done.out.splitlines() == [
        "r1/talk → /talk [std_msgs/msg/String]",
        "r1/talk ← /talk [std_msgs/msg/String]",
        "stopped",
    ]


def test_what_cannot_be_is_said(run: Run) -> None:
    table = {
        ("ros2", "bridge", "--topic", "/talk"): (2, "is not NAME:=TYPE"),
        ("ros2", "bridge", "--topic", "/talk:=std_msgs/Strin"): (2, "did you mean std_msgs/msg/String"),
    }
    assert_reported(run, table)
