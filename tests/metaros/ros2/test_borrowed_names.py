"""Names that programs import from modules that only use them, as in ROS 2."""

from __future__ import annotations

import importlib
from types import ModuleType

import pytest

from metaros.ros2.borrowed_names import BORROWERS, lend
from metaros.ros2.rclpy.core import publisher
from metaros.ros2.rclpy.core.rcl_errors import RCLError
from metaros.ros2.rosidl.catalogue import interface


@pytest.mark.usefixtures("ros2_names")
def test_every_name_is_found_and_is_the_one_that_it_is_elsewhere() -> None:
    for module, names in BORROWERS.items():
        found = importlib.import_module(module)
        for name in names.split():
            assert getattr(found, name).__class__ is not None, f"{module}.{name}"
    node = importlib.import_module("rclpy.node")
    assert node.Publisher is importlib.import_module("rclpy.publisher").Publisher is publisher.Publisher
    assert node.ParameterType is interface("rcl_interfaces/msg/ParameterType")
    assert node.ParameterMsg is importlib.import_module("rclpy.parameter").ParameterMsg
    assert node.ParameterMsg is interface("rcl_interfaces/msg/Parameter")
    assert importlib.import_module("rclpy").executors.Task is importlib.import_module("rclpy.task").Task
    assert importlib.import_module("rclpy._rclpy_pybind11").RCLError is RCLError
    assert importlib.import_module("launch.launch_description").LaunchDescription is not None
    with pytest.raises(AttributeError, match=r"'rclpy\.node' has no attribute 'GoalStatus'"):
        node.GoalStatus  # noqa: B018


def test_a_modules_own_names_come_first() -> None:
    module = ModuleType("m")
    module.__dict__.update(Clock=5, __getattr__=lambda name: f"own {name}")
    for _ in range(2):
        lend("rclpy.time_source", module)
    assert (module.Clock, module.ROSClock.__name__, module.other) == (5, "ROSClock", "own other")
