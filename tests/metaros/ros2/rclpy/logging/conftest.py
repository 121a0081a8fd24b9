"""Loggers belong to the process: each test gets them as they are at its start, and leaves them so."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from metaros.ros2.rclpy.logging import loggers
from metaros.ros2.rclpy.logging.state import STATE


@pytest.fixture(autouse=True)
def loggers_as_at_start(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No levels, and nothing that the environment says of lines."""
    for name in ("CONSOLE_OUTPUT_FORMAT", "COLORIZED_OUTPUT", "LOGGING_USE_STDOUT", "LOGGING_BUFFERED_STREAM"):
        monkeypatch.delenv(f"RCUTILS_{name}", raising=False)
    monkeypatch.setattr(STATE, "to_terminal", type(STATE)().to_terminal)
    loggers.clear_config()
    yield
    loggers.clear_config()
