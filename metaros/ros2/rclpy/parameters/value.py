"""A parameter: one named value with its type, and its way to rcl_interfaces messages and back."""

from __future__ import annotations

import array
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, Final, Generic

from metaros.ros2.rosidl.catalogue import interface

if TYPE_CHECKING:
    from typing_extensions import TypeVar  # checkers know it; it need not be installed

    T = TypeVar("T", default=Any)
else:
    from typing import TypeVar

    T = TypeVar("T")

__all__ = [
    "PARAMETER_SEPARATOR_STRING",
    "AllowableParameterValue",
    "Parameter",
    "parameter_value_to_python",
]

PARAMETER_SEPARATOR_STRING: Final = "."

AllowableParameterValue = (
    bool | int | float | str | Sequence[bytes] | Sequence[bool] | Sequence[int] | Sequence[float] | Sequence[str] | None
)

_LISTS: Final = (list, tuple)
_ARRAYS: Final = (list, tuple, array.array)


class Parameter(Generic[T]):
    """A name, a type and a value. Without a type it is that of the value; without both nothing is set.

    TypeError where the value or the type is none, ValueError where they do not agree.
    """

    class Type(Enum):
        """The type of a parameter's value, numbered as in rcl_interfaces/msg/ParameterType."""

        NOT_SET = 0
        BOOL = 1
        INTEGER = 2
        DOUBLE = 3
        STRING = 4
        BYTE_ARRAY = 5
        BOOL_ARRAY = 6
        INTEGER_ARRAY = 7
        DOUBLE_ARRAY = 8
        STRING_ARRAY = 9

        @classmethod
        def from_parameter_value(cls, parameter_value: Any) -> Parameter.Type:
            """The type of a value; TypeError where no parameter has it. Without items a list is a byte array."""
            if parameter_value is None:
                return cls.NOT_SET
            for kind, python in _SCALARS.items():
                if isinstance(parameter_value, python):
                    return kind
            if isinstance(parameter_value, _ARRAYS):
                for kind, python in _ITEMS.items():
                    if all(isinstance(item, python) for item in parameter_value):
                        return kind
                kinds = "its items must all be bytes, bool, int, float or str"
                raise TypeError(f"{parameter_value!r} is no parameter value: {kinds}")
            kinds = "bool, int, float, str, and lists of bytes or of these are"
            raise TypeError(f"{parameter_value!r} is no parameter value: {kinds}")

        def check(self, parameter_value: Any) -> bool:
            """Whether the value is of this type; nothing is converted: 1 is no double."""
            if self is Parameter.Type.NOT_SET:
                return parameter_value is None
            scalar = _SCALARS.get(self)
            if scalar is not None:
                return isinstance(parameter_value, scalar)
            item_type = _ITEMS[self]
            sequences = _ARRAYS if item_type in (int, float) else _LISTS
            if not isinstance(parameter_value, sequences):
                return False
            if item_type is bytes:
                return all(isinstance(item, bytes) and len(item) == 1 for item in parameter_value)
            return all(isinstance(item, item_type) for item in parameter_value)

    def __init__(self, name: str, type_: Parameter.Type | None = None, value: Any = None) -> None:
        if type_ is None:
            type_ = Parameter.Type.from_parameter_value(value)
        if not isinstance(type_, Parameter.Type):
            raise TypeError(f"the type of parameter {name!r} must be one of Parameter.Type, not {type_!r}")
        if not type_.check(value):
            raise ValueError(f"parameter {name!r}: the value {value!r} is not of type {type_.name}")
        self._type_ = type_
        self._name = name
        self._value = value

    def __repr__(self) -> str:
        return f"Parameter({self._name!r}, {self._type_}, {self._value!r})"

    @classmethod
    def from_parameter_msg(cls, param_msg: Any) -> Parameter[Any]:
        """The parameter that a rcl_interfaces/msg/Parameter tells of."""
        kind = Parameter.Type(int(param_msg.value.type))
        value = None if kind is Parameter.Type.NOT_SET else getattr(param_msg.value, _FIELDS[kind])
        return cls(param_msg.name, kind, value)

    @property
    def name(self) -> str:
        """Its name; dots group parameters."""
        return self._name

    @property
    def type_(self) -> Parameter.Type:
        """The type of its value."""
        return self._type_

    @property
    def value(self) -> Any:
        """Its value; None where it is not set."""
        return self._value

    def get_parameter_value(self) -> Any:
        """Its value as a rcl_interfaces/msg/ParameterValue."""
        message = interface("rcl_interfaces/msg/ParameterValue")(type=self._type_.value)
        if self._type_ is not Parameter.Type.NOT_SET:
            setattr(message, _FIELDS[self._type_], self._value)
        return message

    def to_parameter_msg(self) -> Any:
        """The whole as a rcl_interfaces/msg/Parameter."""
        return interface("rcl_interfaces/msg/Parameter")(name=self._name, value=self.get_parameter_value())


# In the order in which they are tried: a bool is an int, too.
_SCALARS: Final[Mapping[Parameter.Type, type]] = {
    Parameter.Type.BOOL: bool,
    Parameter.Type.INTEGER: int,
    Parameter.Type.DOUBLE: float,
    Parameter.Type.STRING: str,
}
_ITEMS: Final[Mapping[Parameter.Type, type]] = {
    Parameter.Type.BYTE_ARRAY: bytes,
    Parameter.Type.BOOL_ARRAY: bool,
    Parameter.Type.INTEGER_ARRAY: int,
    Parameter.Type.DOUBLE_ARRAY: float,
    Parameter.Type.STRING_ARRAY: str,
}
_FIELDS: Final[Mapping[Parameter.Type, str]] = {
    kind: f"{kind.name.lower()}_value" for kind in Parameter.Type if kind is not Parameter.Type.NOT_SET
}


def parameter_value_to_python(parameter_value: Any) -> Any:
    """The value inside a rcl_interfaces/msg/ParameterValue, arrays as lists; RuntimeError for a type that is none."""
    try:
        kind = Parameter.Type(int(parameter_value.type))
    except ValueError:
        raise RuntimeError(f"{parameter_value.type} is no type of a parameter value") from None
    if kind is Parameter.Type.NOT_SET:
        return None
    value = getattr(parameter_value, _FIELDS[kind])
    return list(value) if kind in _ITEMS else value
