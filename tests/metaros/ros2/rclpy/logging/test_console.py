"""Lines as the environment wants them."""

from __future__ import annotations

import io
import re
import sys

import pytest

from metaros.ros2.rclpy.logging.console import Console, Record

RECORD = Record("WARN", "robot.arm", "hot", 1_700_000_000_123_456_789, "move", "/a/arm.py", 7)


def line(form: str) -> str:
    """The record in that format."""
    return Console({"RCUTILS_CONSOLE_OUTPUT_FORMAT": form}).line(RECORD)


def test_the_format_is_rcutils() -> None:
    assert Console({}).line(RECORD) == "[WARN] [1700000000.123456789] [robot.arm]: hot"
    expected = {
        "{severity} {name} {message}": "WARN robot.arm hot",
        "{file_name}:{line_number} {function_name}()": "/a/arm.py:7 move()",
        "{time} {time_as_nanoseconds}": "1700000000.123456789 1700000000123456789",
        "{unknown} {message": "{unknown} {message",
        r"{name}\t{message}\n": "robot.arm\thot\n",
    }
    assert {form: line(form) for form in expected} == expected
    assert re.fullmatch(r"2023-11-1\d \d\d:\d\d:20\.123", line("{date_time_with_ms}"))


def test_colours_go_where_they_are_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {}
    for wanted in ("", "0", "1"):
        for terminal in (True, False):
            stream = io.StringIO()
            stream.isatty = lambda terminal=terminal: terminal  # type: ignore[method-assign, misc]
            monkeypatch.setattr(sys, "stderr", stream)
            Console({"RCUTILS_COLORIZED_OUTPUT": wanted}).write(RECORD)
            found[wanted, terminal] = stream.getvalue().startswith("\033[33m[WARN]")
    assert [case for case, coloured in found.items() if coloured] == [("", True), ("1", True), ("1", False)]


def test_stdout_if_asked(capsys: pytest.CaptureFixture[str]) -> None:
    for value in ("", "0", "1"):
        Console({"RCUTILS_LOGGING_USE_STDOUT": value}).write(RECORD)
    out, err = capsys.readouterr()
    assert (out.count("hot"), err.count("hot")) == (1, 2)


def test_other_values_are_refused() -> None:
    for name in ("COLORIZED_OUTPUT", "LOGGING_USE_STDOUT", "LOGGING_BUFFERED_STREAM"):
        with pytest.raises(ValueError, match=f"{name} is 'yes': 0 or 1"):
            Console({f"RCUTILS_{name}": "yes"})
