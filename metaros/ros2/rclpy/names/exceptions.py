"""The errors of rclpy by their names: `rclpy.exceptions`, and those that rclpy keeps in its C extension.

Where an error of this library means the same, each is that one, too, so that code of either kind can catch it.
"""

from __future__ import annotations

from typing import Any

from metaros.errors import NameError_, ParameterError, UsageError
from metaros.ros2.rclpy.core.rcl_errors import (
    InvalidHandle,
    NodeNameNonExistentError,
    RCLError,
    RCLInvalidROSArgsError,
    TimerCancelledError,
    UnknownROSArgsError,
    UnsupportedEventTypeError,
)

__all__ = [
    "InvalidHandle",
    "InvalidNamespaceException",
    "InvalidNodeNameException",
    "InvalidParameterException",
    "InvalidParameterTypeException",
    "InvalidParameterValueException",
    "InvalidServiceNameException",
    "InvalidTopicNameException",
    "NameValidationException",
    "NoTypeSupportImportedException",
    "NodeNameNonExistentError",
    "NotInitializedException",
    "ParameterAlreadyDeclaredException",
    "ParameterException",
    "ParameterImmutableException",
    "ParameterNotDeclaredException",
    "ParameterUninitializedException",
    "RCLError",
    "RCLInvalidROSArgsError",
    "ROSInterruptException",
    "TimerCancelledError",
    "UnknownROSArgsError",
    "UnsupportedEventTypeError",
]


class NotInitializedException(UsageError):
    """Something needs a context that is initialised, and `rclpy.init()` was not called."""

    def __init__(self, message: str | None = None) -> None:
        text = "rclpy.init() has not been called, call it first"
        super().__init__(f"{text}: {message}" if message else text)


class NoTypeSupportImportedException(UsageError):
    """A class that looks like a message or service has no type support: nothing can encode it."""

    def __init__(self, *_: object) -> None:
        super().__init__("no type support: the class is no interface that this library can encode")


class ROSInterruptException(Exception):
    """What a blocking call waited for cannot come any more: the context was shut down."""

    def __init__(self) -> None:
        super().__init__("rclpy.shutdown() has been called")


# -- names -------------------------------------------------------------------------------------------------------------


class NameValidationException(NameError_):
    """A name breaks the grammar of ROS names; the message points at the character."""

    def __init__(self, name_type: str, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__(f"Invalid {name_type}: {error_msg}:\n  '{name}'\n   {' ' * invalid_index}^")


class InvalidNamespaceException(NameValidationException):
    """Not a namespace."""

    def __init__(self, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__("namespace", name, error_msg, invalid_index)


class InvalidNodeNameException(NameValidationException):
    """Not a node's name."""

    def __init__(self, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__("node name", name, error_msg, invalid_index)


class InvalidTopicNameException(NameValidationException):
    """Not a topic's name."""

    def __init__(self, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__("topic name", name, error_msg, invalid_index)


class InvalidServiceNameException(NameValidationException):
    """Not a service's name."""

    def __init__(self, name: str, error_msg: str, invalid_index: int) -> None:
        super().__init__("service name", name, error_msg, invalid_index)


# -- parameters --------------------------------------------------------------------------------------------------------


class ParameterException(ParameterError):
    """The root of errors of parameters."""

    def __init__(self, error_msg: str, parameters: Any) -> None:
        super().__init__(f"{error_msg}: {parameters}")


class ParameterNotDeclaredException(ParameterException):
    """A parameter is used that was not declared, where that is not allowed."""

    def __init__(self, parameters: Any) -> None:
        super().__init__("Invalid access to undeclared parameter(s), declare them first", parameters)


class ParameterAlreadyDeclaredException(ParameterException):
    """A parameter is declared a second time."""

    def __init__(self, parameters: Any) -> None:
        super().__init__("Parameter(s) already declared", parameters)


class InvalidParameterException(ParameterException):
    """Not a parameter's name."""

    def __init__(self, parameter_name: str) -> None:
        super().__init__("Invalid parameter name", parameter_name)


class InvalidParameterTypeException(ParameterException):
    """A value of another type than the parameter was declared with."""

    def __init__(self, desired_parameter: Any, expected_type: Any) -> None:
        given = type(desired_parameter).Type.from_parameter_value(desired_parameter.value).name
        expected = getattr(expected_type, "name", expected_type)
        text = f"Trying to set parameter '{desired_parameter.name}' to '{desired_parameter.value}' of type '{given}'"
        super().__init__(f"{text}, expecting type '{expected}'", desired_parameter.name)


class InvalidParameterValueException(ParameterException):
    """A value that a callback or the parameter's descriptor refuses."""

    def __init__(self, parameter: str, value: Any, reason: str) -> None:
        super().__init__(f"Invalid parameter value ({value}) for parameter. Reason: {reason}", parameter)


class ParameterImmutableException(ParameterException):
    """A read-only parameter would be changed."""

    def __init__(self, parameter_name: Any) -> None:
        super().__init__("Attempted to modify read-only parameter", parameter_name)


class ParameterUninitializedException(ParameterException):
    """A parameter that has a type and no value yet is read."""

    def __init__(self, parameter_name: Any) -> None:
        super().__init__("The parameter is not initialized, set a value first", parameter_name)
