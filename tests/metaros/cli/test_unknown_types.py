"""`metaros topic echo` reads types that only another process knows: it asks that process's node."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.metaros.cli.conftest import Run
from tests.support.robots.custom_types_robot import custom_types_robot


@pytest.fixture(scope="module")
def robot(zenoh_router: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A program of its own, with types of its own."""
    with custom_types_robot(zenoh_router, tmp_path_factory.mktemp("robot") / "log"):
        yield


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
