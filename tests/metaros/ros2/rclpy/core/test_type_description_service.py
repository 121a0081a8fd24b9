"""Definitions of types from an rclpy node."""

from __future__ import annotations

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.core.type_description_service import TypeDescriptionService
from metaros.ros2.rclpy.names.exceptions import ParameterImmutableException
from metaros.ros2.rclpy.parameters.value import Parameter

NAME = "start_type_description_service"


def test_it_is_offered_unless_a_parameter_says_no(rclpy_context: Context) -> None:
    with Node("teller", context=rclpy_context) as node:
        assert node.count_services("~/get_type_description") == 1
        assert not node.set_parameters([Parameter(NAME, value=False)])[0].successful
        assert node.describe_parameter(NAME).read_only
        second = TypeDescriptionService(node)
        assert node.count_services("~/get_type_description") == 2
        second.destroy()
        second.destroy()
        assert node.count_services("~/get_type_description") == 1
    with Node("mute", context=rclpy_context, parameter_overrides=[Parameter(NAME, value=False)]) as node:
        assert node.count_services("~/get_type_description") == 0
        with pytest.raises(ParameterImmutableException):
            node.undeclare_parameter(NAME)
