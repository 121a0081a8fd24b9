"""What tests of the ROS 2 face share. Helpers: add fixtures here, keep them small."""

from __future__ import annotations

import importlib
from collections.abc import Iterator

import pytest

from metaros.ros2 import install, uninstall
from metaros.ros2.rclpy.core.context import Context
from tests.support.servers.routers import zenoh_router


@pytest.fixture
def ros2_names() -> Iterator[None]:
    """`import rclpy`, `std_msgs.msg` … lead to our modules during the test."""
    install(shadow=True)
    yield
    uninstall()


@pytest.fixture(scope="session")
def ros2_router() -> Iterator[str]:
    """The port of a router that all tests of a worker share, in METAROS_ZENOH_PORT's terms."""
    with zenoh_router() as endpoint:
        yield endpoint.rpartition(":")[2]


@pytest.fixture(scope="module")
def rclpy_context(ros2_router: str) -> Iterator[Context]:
    """An rclpy context on that router, without arguments, that the tests of a module share."""
    context = Context()
    context.init([])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("METAROS_ZENOH_PORT", ros2_router)
        assert context.handle is not None  # opens the session
    yield context
    context.try_shutdown()


@pytest.fixture
def rclpy_program(ros2_names: None, ros2_router: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As in a program's process: no arguments, a router, and nothing left of rclpy at the end."""
    monkeypatch.setenv("METAROS_ZENOH_PORT", ros2_router)
    monkeypatch.setattr("sys.argv", ["program"])
    yield
    rclpy = importlib.import_module("rclpy")
    rclpy.try_shutdown()
    rclpy.uninstall_signal_handlers()
