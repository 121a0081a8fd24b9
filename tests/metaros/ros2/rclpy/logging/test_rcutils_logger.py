"""What a logger shows: by level, and by the filters of a line."""

from __future__ import annotations

import re
from typing import Any

import pytest

from metaros.ros2.rclpy.logging import loggers
from metaros.ros2.rclpy.logging.severity import LoggingSeverity
from metaros.ros2.rclpy.time.clock import ROSClock
from metaros.ros2.rclpy.time.time import Time

INFO = LoggingSeverity.INFO


def shown(times: int, **arguments: Any) -> list[bool]:
    """Whether each of so many messages of one line is shown."""
    logger = loggers.get_logger("robot")
    return [logger.log(f"message {number}", INFO, **arguments) for number in range(times)]


def at_seconds(*seconds: int, **arguments: Any) -> list[bool]:
    """The same by a clock that shows these seconds, one after another."""
    logger, clock = loggers.get_logger("robot"), ROSClock()
    clock._set_ros_time_is_active(True)
    found = []
    for now in seconds:
        clock.set_ros_time_override(Time(seconds=now, clock_type=clock.clock_type))
        found.append(logger.info("message", throttle_time_source_type=clock, **arguments))
    return found


def test_messages_below_the_level_are_not_shown(capsys: pytest.CaptureFixture[str]) -> None:
    logger = loggers.get_logger("robot")
    found = [logger.debug("debug"), logger.info("info"), logger.warning("warning"), logger.warn("warn")]
    found += [logger.error("error"), logger.fatal("fatal")]
    assert found == [False, True, True, True, True, True]
    lines = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"\[INFO\] \[\d{10}\.\d{9}\] \[robot\]: info", lines[0])
    assert [line[1:6].strip("]") for line in lines] == ["INFO", "WARN", "WARN", "ERROR", "FATAL"]
    assert logger.is_enabled_for(20)
    assert not logger.is_enabled_for(LoggingSeverity.DEBUG)


def test_filters_of_a_line() -> None:
    assert shown(4, once=True) == [True, False, False, False]
    assert shown(4, once=False) == [True, True, True, True]
    assert shown(4, skip_first=True) == [False, True, True, True]
    assert shown(4, skip_first=True, once=True) == [False, True, False, False]
    assert shown(2, throttle_duration_sec=1000.0) == [True, False]
    assert shown(2, throttle_duration_sec=0) == [True, True]


def test_throttling_goes_by_the_clock() -> None:
    assert at_seconds(0, 1, 2, 3, 4, throttle_duration_sec=2) == [False, False, True, False, True]
    assert at_seconds(9, 9, 10, throttle_duration_sec=1) == [True, False, True]
    assert at_seconds(9, 9, 10, throttle_duration_sec=1, skip_first=True) == [False, False, True]
    with pytest.raises(ValueError, match="not a clock"):
        shown(1, throttle_duration_sec=1, throttle_time_source_type="RCUTILS_STEADY_TIME")


def test_each_logger_and_each_line_filters_for_itself() -> None:
    for logger in (loggers.get_logger("robot"), loggers.get_logger("other"), loggers._root_logger):
        assert [logger.info("x", once=True) for _ in range(2)] == [True, False]
    logger = loggers.get_logger("robot")
    assert (logger.info("x", once=True), logger.info("x", once=True)) == (True, True)


def test_arguments_that_nobody_knows_are_refused() -> None:
    with pytest.raises(TypeError, match=r"required parameter .* not specified"):
        shown(1, throttle_time_source_type=ROSClock())
    with pytest.raises(TypeError, match=r"parameter .* is not one of the recognized"):
        shown(1, name="other", skip_first=True, twice=True)
    with pytest.raises(TypeError, match="got multiple values for argument 'severity'"):
        loggers.get_logger("robot").fatal("x", severity=INFO)


def test_a_line_may_not_change_its_mind() -> None:
    changes: dict[str, list[dict[str, Any]]] = {
        "parameters cannot be changed between": [{"throttle_duration_sec": 1}, {"throttle_duration_sec": 2}],
        "name cannot be changed between": [{"name": "a"}, {"name": "b"}],
        "severity cannot be changed between": [{"severity": INFO}, {"severity": LoggingSeverity.WARN}],
        "filters cannot be changed between": [{"once": True}, {"once": False}],
    }
    for words, calls in changes.items():
        with pytest.raises(ValueError, match=words):
            _calls_of_one_line([{"severity": INFO} | arguments for arguments in calls])


def _calls_of_one_line(calls: list[dict[str, Any]]) -> None:
    logger = loggers.get_logger("robot")
    for arguments in calls:
        logger.log("message", **arguments)
