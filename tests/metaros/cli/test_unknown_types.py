"""`metaros topic echo` reads types that only another process knows: it asks that process's node."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.metaros.cli.conftest import Run
from tests.support.far_robot import far_robot


@pytest.fixture
def robot(zenoh_router: str, tmp_path: Path) -> Iterator[None]:
    """A program of its own, with types of its own."""
    with far_robot(zenoh_router, tmp_path / "log"):
        yield


def test_echo_of_a_type_that_only_its_publisher_knows(robot: None, run: Run) -> None:
    done = run("topic", "echo", "/hand", "--once", "--spin-time", "60")
    assert done.stderr == ""
    assert done.returncode == 0
    assert "fingers:\n- angle: 0.25\n- angle: 1.5\n" in done.stdout
    assert "grip: soft" in done.stdout
    named = run(
        "topic", "echo", "/hand", "far_robot/Hand", "--once", "--field", "fingers[1].angle", "--spin-time", "60"
    )
    assert (named.stdout, named.stderr) == ("1.5\n---\n", "")


def test_echo_of_a_shipped_name_with_the_publishers_own_fields(robot: None, run: Run) -> None:
    done = run("topic", "echo", "/other", "--once", "--spin-time", "60")
    assert (done.returncode, done.stdout) == (0, "data: 77\n---\n")
