"""The conformance kit: who takes part, and the table at the end of `make conformance`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.ros2.cast import ROS, Cast
from tests.ros2.scenarios import report
from tests.support.servers.routers import zenoh_router as started_router


def pytest_sessionstart() -> None:
    """A wrong ROS= is told at once, and not by each test."""
    if ROS and not (Path(ROS) / "setup.bash").is_file():
        raise pytest.UsageError(f"ROS={ROS} has no setup.bash: it is the folder of an installation, as /opt/ros/jazzy")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A scenario is played by all pairs that can."""
    if hasattr(metafunc.function, "scenario"):
        report.plan(metafunc)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """For the table."""
    from tests.ros2 import scenarios

    scenarios.report.note(report)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """What was checked with whom."""
    if os.environ.get("METAROS_CONFORMANCE"):
        terminalreporter.section("what is on the wire, and what is read from it, with whom")
        for line in report.lines():
            terminalreporter.write_line(line)


@pytest.fixture(scope="session")
def cast() -> Iterator[Cast]:
    """All participants, on one router."""
    with started_router() as endpoint:
        made = Cast(endpoint)
        yield made
        made.close()


@pytest.fixture
def teller(request: pytest.FixtureRequest, cast: Cast) -> Iterator[Any]:
    """Who offers something; what a test makes of it goes with the test."""
    with cast[request.param].lending():
        yield cast[request.param]


@pytest.fixture
def hearer(request: pytest.FixtureRequest, cast: Cast) -> Iterator[Any]:
    """Who uses it."""
    with cast[request.param].lending():
        yield cast[request.param]
