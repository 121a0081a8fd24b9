"""Commands use types that only another process knows by name alone: they ask that process's node."""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Iterator

import pytest

from metaros.idl import known
from tests.metaros.cli.conftest import Run, assert_reported
from tests.support.robots.custom_types_robot import custom_types_robot


@pytest.fixture(scope="module")
def robot(zenoh_router: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A program of its own, with types of its own."""
    with custom_types_robot(zenoh_router, tmp_path_factory.mktemp("robot") / "log"):
        yield


@pytest.fixture(autouse=True)
def told_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test begins as a new process does."""
    monkeypatch.setattr(known, "_known", OrderedDict())


def test_echo_of_a_type_that_only_its_publisher_knows(robot: None, run: Run) -> None:
    done = run("topic", "echo", "/hand", "--once")
    assert done.err == ""
    assert done.code == 0
    assert "fingers:\n- angle: 0.25\n- angle: 1.5\n" in done.out
    assert "grip: soft" in done.out
    named = run("topic", "echo", "/hand", "far_robot/Hand", "--once", "--field", "fingers[1].angle")
    assert (named.out, named.err) == ("1.5\n---\n", "")


def test_echo_of_a_shipped_name_with_the_publishers_own_fields(robot: None, run: Run) -> None:
    done = run("topic", "echo", "/other", "--once")
    assert (done.code, done.out) == (0, "data: 77\n---\n")


def test_services_are_called_and_goals_sent(robot: None, run: Run) -> None:
    assert run("service", "call", "/wave", "{times: 3}").out == "done: true\nangle: 1.5\n"
    named = run("service", "call", "/wave", "far_robot/Wave", "{times: 1}", "-o", "json")
    assert json.loads(named.out) == {"done": True, "angle": 0.5}
    goal = run("action", "send_goal", "/reach", "far_robot/Reach", "{path: [{name: a}, {name: b}]}", "-f")
    assert (goal.code, goal.err) == (0, "")
    assert "error: 1.0" in goal.out
    assert "SUCCEEDED" in goal.out
    assert "name: b" in goal.out  # its feedback
    assert "0.5" in run("action", "send_goal", "/reach", "{path: [{}]}").out
    wrong = {
        ("service", "call", "/wave", "{tims: 3}"): (2, "tims"),
        ("service", "call", "/wave", "far_robot/Wave", "[3]"): (2, "how: text"),
        ("service", "call", "/wave", "std_srvs/Trigger"): (2, "/wave is a far_robot/srv/Wave, not a std_srvs"),
        ("service", "call", "/wave", "std_srvs/Triger"): (2, "did you mean std_srvs/srv/Trigger"),
        ("action", "send_goal", "/reach", "{path: [{nam: a}]}"): (2, "nam"),
        ("action", "send_goal", "/reach", "far_robot/Wave"): (2, "/reach is a far_robot/action/Reach"),
    }
    assert_reported(run, wrong)


def test_messages_are_published(robot: None, run: Run) -> None:
    done = run("topic", "pub", "/squeeze", "far_robot/Squeeze", "{joint: {name: thumb}}", "--once")
    assert (done.code, done.err) == (0, "")
    assert "force=5" in done.out
    assert run("topic", "echo", "/squeezed", "--once").out == "data: thumb 5\n---\n"
    wrong = {
        ("topic", "pub", "/squeeze", "far_robot/Squeze", "--once"): (2, "no node that is there now uses it"),
        ("topic", "pub", "/squeeze", "far_robot/Squeeze", "{jont: {}}"): (2, "jont"),
    }
    assert_reported(run, wrong)


def test_show_says_who_told_it(robot: None, run: Run) -> None:
    shown = run("interface", "show", "far_robot/Reach").out.splitlines()
    assert shown[0].startswith("# far_robot/action/Reach  RIHS01_")
    assert shown[1:] == [
        "# told by /hand",
        "uint8 FAST=2",
        "far_robot/Joint[] path",
        "\tfloat32 angle",
        "\tstring name",
        "uint8 speed 1",
        "---",
        "float64 error",
        "---",
        "far_robot/Joint now",
        "\tfloat32 angle",
        "\tstring name",
    ]
    told = json.loads(run("interface", "show", "far_robot/srv/Wave", "-o", "json").out)
    assert (told["told_by"], told["definition"].splitlines()[0]) == ("/hand", "string<=8 how")
    assert "speed: 1" in run("interface", "proto", "far_robot/Reach").out
    hashes = json.loads(run("interface", "hash", "far_robot/Reach", "-o", "json").out)
    assert list(hashes)[1] == "far_robot/action/Reach_SendGoal"
    assert "told by" not in run("interface", "show", "std_msgs/String").out
    wrong = {
        ("interface", "show", "far_robot/Reech"): (2, "no node that is there now uses it"),
        ("interface", "show", "std_msgs/Strin"): (2, "did you mean std_msgs/msg/String"),
    }
    assert_reported(run, wrong)
