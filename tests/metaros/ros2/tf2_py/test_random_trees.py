"""`tf2_py` against plain matrices, on seeded trees. Ten thousand of them: `make campaign ARGS=transforms`."""

from __future__ import annotations

import logging

import pytest

from metaros.ros2 import tf2_py
from tests.support.ros2.random_trees import check_tree


@pytest.fixture(autouse=True)
def quiet(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.ERROR, "metaros.ros2.tf2")  # old data is refused, as it shall be


def run(seeds: range) -> int:
    return sum(check_tree(seed, tf2_py.BufferCore, tf2_py) for seed in seeds)


def test_lookups_are_what_matrices_say_and_errors_are_tf2s() -> None:
    assert run(range(80)) > 500


@pytest.mark.integration
def test_the_same_on_more_trees() -> None:
    assert run(range(1000, 1600)) > 4000
