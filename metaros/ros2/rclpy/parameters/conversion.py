"""Values of parameter files, of the command line and of the wire, as the values that rclpy's parameters have."""

from __future__ import annotations

import array
from collections.abc import Mapping
from typing import Any, Final

from metaros.errors import ParameterError
from metaros.node.parameters.values import ParameterType, Value, infer
from metaros.ros2.rclpy.parameters.value import Parameter

__all__ = ["from_wire", "message_of", "parameters_of", "to_wire"]

_CODES: Final[Mapping[Parameter.Type, str]] = {
    Parameter.Type.INTEGER_ARRAY: "q",
    Parameter.Type.DOUBLE_ARRAY: "d",
}


def message_of(name: str, value: Value) -> Any:
    """A value of a file as a rcl_interfaces/msg/Parameter."""
    return Parameter(name, value=_python(value)).to_parameter_msg()


def parameters_of(values: Mapping[str, Any]) -> dict[str, Parameter[Any]]:
    """What the command line and its files say, by name; ParameterError where a value is none, such as a mapping.

    Nothing at all, as in `-p name:=`, is no value.
    """
    found = {}
    for name, given in values.items():
        try:
            value = infer(given)
        except ParameterError as error:
            raise ParameterError(f"the value given to parameter {name}: {error}") from None
        if value is not None:
            found[name] = Parameter(name, value=_python(value))
    return found


def from_wire(message: Any) -> Parameter[Any]:
    """A parameter that somebody sent, as rclpy gives it to callbacks: numbers of an array are an `array.array`."""
    from metaros.node.parameters.wire import read_value

    kind = Parameter.Type(int(message.value.type))
    value: Any = _python(read_value(message.value))
    code = _CODES.get(kind)
    return Parameter(message.name, kind, value if code is None else array.array(code, value))


def to_wire(parameter: Parameter[Any]) -> Any:
    """Its value as a message that this library's own codecs send."""
    from metaros.node.parameters.wire import value_message

    kind, value = parameter.type_, parameter.value
    if kind is Parameter.Type.BYTE_ARRAY:
        value = b"".join(value)
    return value_message(list(value) if isinstance(value, tuple) else value, ParameterType(kind.value))


def _python(value: Value) -> Any:
    """Bytes are a list of single bytes in rclpy."""
    return [bytes((byte,)) for byte in value] if isinstance(value, bytes) else value
