"""The tuples that `declare_parameters` takes: what each of them declares."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from typing import Any

from metaros.ros2.rclpy.names.validate_parameter_name import validate_parameter_name
from metaros.ros2.rclpy.parameters.value import PARAMETER_SEPARATOR_STRING, Parameter, parameter_value_to_python
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["read_declarations"]


def read_declarations(
    namespace: str, tuples: Iterable[Any], overrides: Mapping[str, Parameter[Any]]
) -> list[tuple[Parameter[Any], Any]]:
    """Each as the parameter, an override in place of its value, and the descriptor, its type filled in.

    TypeError where a tuple has a wrong length or wrong parts, ValueError where it leaves the type open,
    InvalidParameterException for a name that is none.
    """
    declared = []
    for index, parts in enumerate(tuples):  # no comprehension: that would be one call more for a warning to go back
        declared.append(_declaration(namespace, index, parts, overrides))
    return declared


def _declaration(
    namespace: str, index: int, parts: Any, overrides: Mapping[str, Parameter[Any]]
) -> tuple[Parameter[Any], Any]:
    where = f"parameter {index} of the list"
    if not 1 <= len(parts) <= 3:
        raise TypeError(
            f"{where}: {parts!r} has {len(parts)} parts; there are (name,), (name, value or type), and"
            " (name, value or type, descriptor)"
        )
    name, second, descriptor = tuple(parts) + (None,) * (3 - len(parts))
    if not isinstance(name, str):
        raise TypeError(f"{where}: its name must be a str, not {name!r}")
    if namespace:
        name = f"{namespace}{PARAMETER_SEPARATOR_STRING}{name}"
    validate_parameter_name(name)
    descriptor_type = interface("rcl_interfaces/msg/ParameterDescriptor")
    if len(parts) < 3:
        descriptor = descriptor_type()
    elif not isinstance(descriptor, descriptor_type):
        raise TypeError(f"{where}: {name}: the third part must be a ParameterDescriptor, not {descriptor!r}")
    if len(parts) == 1:
        _warn_of_bare_name(name)
        descriptor.dynamic_typing = True
    value = _value(name, second, descriptor)
    override = overrides.get(name)
    return Parameter(name, value=value) if override is None else Parameter(name, value=override.value), descriptor


def _value(name: str, second: Any, descriptor: Any) -> Any:
    """The value that the second part gives, None for a mere type; the descriptor learns the type."""
    if isinstance(second, Parameter.Type):
        if second is Parameter.Type.NOT_SET:
            raise ValueError(f"Cannot declare parameter {name} with the type NOT_SET: give another, or dynamic_typing")
        if descriptor.dynamic_typing:
            raise ValueError(f"parameter {name} has a type, so that its descriptor may not ask for dynamic_typing")
        descriptor.type = second.value
        return None
    if isinstance(second, interface("rcl_interfaces/msg/ParameterValue")):
        second = parameter_value_to_python(second)
    if not descriptor.dynamic_typing:
        kind = Parameter.Type.from_parameter_value(second)
        if kind is Parameter.Type.NOT_SET:
            raise ValueError(
                f"Cannot declare parameter {name} without a type: give a value, a Parameter.Type, or a descriptor with"
                " dynamic_typing"
            )
        descriptor.type = kind.value
    return second


def _warn_of_bare_name(name: str) -> None:
    warnings.warn(
        f"when declaring parameter {name!r}: a name alone is deprecated; give a value or a Parameter.Type as well, or a"
        " descriptor with dynamic_typing=True",
        stacklevel=6,  # who called the node's method
    )
