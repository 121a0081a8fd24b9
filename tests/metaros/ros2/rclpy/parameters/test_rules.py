"""Ranges and steps: which values a descriptor lets pass."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rclpy.parameters.rules import refusal
from metaros.ros2.rclpy.parameters.value import Parameter
from metaros.ros2.rosidl.catalogue import interface
from tests.support.tables import cases


def judge(value: Any, **fields: Any) -> str:
    parameter = Parameter("p", value=value)
    rule = interface("rcl_interfaces/msg/ParameterDescriptor")(type=parameter.type_.value, **fields)
    return refusal(parameter, rule, declared=True, check_read_only=True)


@cases(
    ("bounds", "value", "reason"),
    [
        ((0, 10, 2), 0, ""),
        ((0, 10, 2), 4, ""),
        ((0, 10, 2), 10, ""),
        ((0, 10, 2), 5, "not a valid step"),
        ((0, 10, 2), 11, "out of range"),
        ((0, 10, 2), -1, "out of range"),
        ((0, 10, 0), 5, ""),
        ((-10, 0, 30), 0, ""),
        ((-10, 0, 30), -4, "not a valid step"),
        ((10, 0, 3), 3, ""),
        ((0, 10, 2), 5.0, ""),
        ((0, 10, 2), "x", ""),
    ],
)
def test_integer_ranges(bounds: tuple[int, int, int], value: Any, reason: str) -> None:
    made = interface("rcl_interfaces/msg/IntegerRange")(from_value=bounds[0], to_value=bounds[1], step=bounds[2])
    found = judge(value, integer_range=[made])
    assert reason in found
    assert bool(found) is bool(reason)


@cases(
    ("bounds", "value", "reason"),
    [
        ((0.0, 10.0, 0.5), 4.5, ""),
        ((0.0, 10.0, 0.1), 0.1 * 3, ""),
        ((0.0, 10.0, 0.5), 4.25, "not close to a valid step"),
        ((0.0, 10.0, 0.5), 10.0 + 1e-7, ""),
        ((0.0, 10.0, 0.5), 10.1, "out of range"),
        ((0.0, 10.0, 0.0), 5.37, ""),
        ((-10.0, 0.0, 30.0), -4.5, "not close to a valid step"),
        ((0.0, 10.0, 0.5), float("nan"), "out of range"),
        ((0.0, 10.0, 0.5), 123, ""),
    ],
)
def test_floating_point_ranges(bounds: tuple[float, float, float], value: Any, reason: str) -> None:
    made = interface("rcl_interfaces/msg/FloatingPointRange")(from_value=bounds[0], to_value=bounds[1], step=bounds[2])
    found = judge(value, floating_point_range=[made])
    assert reason in found
    assert bool(found) is bool(reason)
