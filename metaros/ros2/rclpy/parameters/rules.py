"""What a descriptor says against a value: type, range, read-only. Pure; an empty reason means that it may be set."""

from __future__ import annotations

import math
from typing import Any, Final

from metaros.ros2.rclpy.parameters.value import Parameter

__all__ = ["REL_TOL", "WRONG_TYPE", "refusal"]

REL_TOL: Final = 1e-6  # doubles seldom hit a bound or a step exactly
WRONG_TYPE: Final = "Wrong parameter type"  # programs look for this beginning
_STATIC: Final = "Static parameter cannot be undeclared"  # and for this


def refusal(parameter: Parameter[Any], descriptor: Any, *, declared: bool, check_read_only: bool) -> str:
    """Why the parameter may not become this. Writes its name, and with dynamic typing its type, into the descriptor."""
    kind, descriptor.name = parameter.type_, parameter.name
    if check_read_only and descriptor.read_only:
        return f"Trying to set a read-only parameter: {parameter.name}."
    if descriptor.dynamic_typing:
        descriptor.type = kind.value
    elif kind is Parameter.Type.NOT_SET:
        if declared:
            return _STATIC
    elif kind.value != descriptor.type:
        return f"{WRONG_TYPE}, expected '{Parameter.Type(descriptor.type)}' got '{kind}'"
    if kind is Parameter.Type.INTEGER and descriptor.integer_range:
        return _integer_fault(parameter, descriptor.integer_range[0])
    if kind is Parameter.Type.DOUBLE and descriptor.floating_point_range:
        return _double_fault(parameter, descriptor.floating_point_range[0])
    return ""


def _integer_fault(parameter: Parameter[Any], bounds: Any) -> str:
    """Both bounds are allowed, and between them each step from the lower one."""
    value, low, high = parameter.value, *sorted((bounds.from_value, bounds.to_value))
    if value in (low, high):
        return ""
    if not low < value < high:
        return f"{parameter.name} is out of range: {value} is not within {low}..{high}"
    if bounds.step and (value - low) % bounds.step:
        return f"{parameter.name} is not a valid step: {value} is not {low} and a number of steps of {bounds.step}"
    return ""


def _double_fault(parameter: Parameter[Any], bounds: Any) -> str:
    """The same, with a tolerance."""
    value, low, high = parameter.value, *sorted((bounds.from_value, bounds.to_value))
    if _close(value, low) or _close(value, high):
        return ""
    if not low < value < high:
        return f"{parameter.name} is out of range: {value} is not within {low}..{high}"
    if bounds.step and not _close(low + round((value - low) / bounds.step) * bounds.step, value):
        return f"{parameter.name} is not close to a valid step: {value} is not {low} and some steps of {bounds.step}"
    return ""


def _close(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=REL_TOL)
