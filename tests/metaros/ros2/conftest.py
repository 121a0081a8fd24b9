"""What tests of the ROS 2 face share. Helpers: add fixtures here, keep them small."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from metaros.ros2 import install, uninstall


@pytest.fixture
def ros2_names() -> Iterator[None]:
    """`import rclpy`, `std_msgs.msg` … lead to our modules during the test."""
    install(shadow=True)
    yield
    uninstall()
