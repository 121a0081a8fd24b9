"""Loggers by name: levels of the tree, and where log files would go."""

from __future__ import annotations

from pathlib import Path

import pytest

from metaros.node.arguments import parse_ros_args
from metaros.ros2.rclpy.logging import loggers
from metaros.ros2.rclpy.logging.severity import LoggingSeverity
from metaros.ros2.rclpy.logging.state import STATE, configure

INFO, WARN, ERROR, DEBUG, UNSET = (LoggingSeverity[name] for name in ("INFO", "WARN", "ERROR", "DEBUG", "UNSET"))


def test_a_logger_goes_by_the_closest_level_above_it() -> None:
    root, child = loggers._root_logger, loggers.get_logger("robot").get_child("arm")
    assert (child.name, child.get_effective_level()) == ("robot.arm", INFO)
    steps = [("", ERROR, ERROR), ("robot", WARN, WARN), ("robot.arm", DEBUG, DEBUG), ("robot.arm", UNSET, WARN)]
    for name, level, expected in steps:
        loggers.set_logger_level(name, level)
        assert child.get_effective_level() is expected, (name, level)
    assert loggers.get_logger_level("robot") is WARN
    assert loggers.get_logger_level("robot.arm") is UNSET
    assert loggers.get_logger_effective_level("robots") is ERROR  # not below `robot`
    loggers.clear_config()
    assert {root.get_effective_level(), child.get_effective_level()} == {INFO}


def test_every_severity_can_be_a_level() -> None:
    logger = loggers.get_logger("robot")
    for severity in LoggingSeverity:
        loggers._root_logger.set_level(severity)
        assert loggers._root_logger.get_effective_level() is severity
        assert loggers.get_logging_severity_from_string(severity.name.lower()) is severity
        logger.set_level(int(severity))
        assert logger.get_effective_level() is severity
    with pytest.raises(ValueError):
        logger.set_level(22)
    with pytest.raises(RuntimeError, match="there are UNSET, DEBUG"):
        loggers.get_logging_severity_from_string("loud")


def test_loggers_without_names_are_refused() -> None:
    with pytest.raises(ValueError, match="Logger name must not be empty"):
        loggers.get_logger("")
    for name in ("", None):
        with pytest.raises(ValueError, match="Child logger name must not be empty"):
            loggers.get_logger("robot").get_child(name)  # type: ignore[arg-type]


def test_the_command_line_sets_levels_and_silence(capsys: pytest.CaptureFixture[str]) -> None:
    words = "p --ros-args --log-level warn --log-level robot:=debug --disable-stdout-logs"
    configure(parse_ros_args(words.split()))
    assert loggers.get_logger_effective_level("other") is WARN
    assert loggers.get_logger("robot").debug("x") is True
    configure(parse_ros_args(["p"]))
    assert loggers.get_logger("robot").debug("y") is True
    assert capsys.readouterr().err.split()[-1:] == ["y"]
    assert STATE.to_terminal


def test_the_directory_of_log_files(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ROS_LOG_DIR", "ROS_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "/home/me")
    found = [loggers.get_logging_directory()]
    monkeypatch.setenv("ROS_HOME", "~/ros")
    found.append(loggers.get_logging_directory())
    monkeypatch.setenv("ROS_LOG_DIR", "/var/log/ros")
    found.append(loggers.get_logging_directory())
    assert found == [Path("/home/me/.ros/log"), Path("/home/me/ros/log"), Path("/var/log/ros")]
