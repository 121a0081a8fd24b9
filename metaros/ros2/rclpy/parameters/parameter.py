"""`rclpy.parameter`: parameters, and what reads them from messages, texts and files."""

from __future__ import annotations

from metaros.ros2.rclpy.parameters.value import (
    PARAMETER_SEPARATOR_STRING,
    AllowableParameterValue,
    Parameter,
    parameter_value_to_python,
)
from metaros.ros2.rclpy.parameters.yaml_files import get_parameter_value, parameter_dict_from_yaml_file

__all__ = [
    "PARAMETER_SEPARATOR_STRING",
    "AllowableParameterValue",
    "Parameter",
    "get_parameter_value",
    "parameter_dict_from_yaml_file",
    "parameter_value_to_python",
]
