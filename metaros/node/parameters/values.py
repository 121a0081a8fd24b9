"""The ten kinds of parameter values of ROS 2, and Python values made to fit one of them."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any, Final, cast

from metaros.errors import ParameterError

__all__ = ["ParameterType", "Value", "as_parameter_type", "convert", "fit", "infer", "kind_of"]

Value = bool | int | float | str | bytes | list[bool] | list[int] | list[float] | list[str] | None
_INT64: Final = range(-(1 << 63), 1 << 63)


class ParameterType(IntEnum):
    """The type of a parameter's value, numbered as on the wire."""

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

    @property
    def label(self) -> str:
        """As ros2's command line prints it: `double`, `string array`."""
        return self.name.lower().replace("_", " ")


_SCALARS: Final[Mapping[type, ParameterType]] = {
    bool: ParameterType.BOOL,
    int: ParameterType.INTEGER,
    float: ParameterType.DOUBLE,
    str: ParameterType.STRING,
}
ELEMENTS: Final[Mapping[ParameterType, type]] = {
    ParameterType.BOOL_ARRAY: bool,
    ParameterType.INTEGER_ARRAY: int,
    ParameterType.DOUBLE_ARRAY: float,
    ParameterType.STRING_ARRAY: str,
}
_ARRAYS: Final = {element: kind for kind, element in ELEMENTS.items()}
_PYTHON: Final[Mapping[Any, ParameterType]] = {
    **_SCALARS,
    bytes: ParameterType.BYTE_ARRAY,
    list[bool]: ParameterType.BOOL_ARRAY,
    list[int]: ParameterType.INTEGER_ARRAY,
    list[float]: ParameterType.DOUBLE_ARRAY,
    list[str]: ParameterType.STRING_ARRAY,
}


def as_parameter_type(kind: object) -> ParameterType:
    """A `ParameterType` from itself, its name (`double_array`) or a Python type (`float`, `list[float]`)."""
    if isinstance(kind, ParameterType):
        return kind
    if isinstance(kind, str) and kind.upper().replace(" ", "_") in ParameterType.__members__:
        return ParameterType[kind.upper().replace(" ", "_")]
    found = [mine for python, mine in _PYTHON.items() if python == kind]
    if not found:
        raise ParameterError(
            f"{kind!r} is no parameter type: bool, int, float, str, bytes, or list[…] of the first four"
        )
    return found[0]


def kind_of(value: Value) -> ParameterType:
    """The type of a plain value; an empty list has none of its own and counts as a string array."""
    if value is None:
        return ParameterType.NOT_SET
    if isinstance(value, bytes):
        return ParameterType.BYTE_ARRAY
    if isinstance(value, list):
        return _ARRAYS[type(value[0])] if value else ParameterType.STRING_ARRAY
    return _SCALARS[type(value)]


def infer(given: object) -> Value:
    """What was given as one of the ten kinds, by itself: with doubles among them whole numbers are doubles, too."""
    value = _plain(given)
    if isinstance(value, list):
        types = {type(item) for item in value}
        if types == {int, float}:
            return [float(item) for item in value]
        if len(types) > 1 or not types <= set(_SCALARS):
            raise ParameterError(
                f"{_shown(value)} is no parameter value: a list holds bools, numbers or texts of one type"
            )
        if types == {int}:
            return [_integer(item) for item in value]
        return value
    if value is None or type(value) in (bool, float, str, bytes):
        return value  # type: ignore[no-any-return]  # narrowed by its exact type
    if type(value) is int:
        return _integer(value)
    raise ParameterError(f"{_shown(value)} ({type(value).__name__}) is no parameter value")


def fit(value: object, kind: ParameterType) -> Value:
    """`value` as a value of `kind`. Only what loses nothing is converted: whole numbers to doubles, an empty list."""
    plain = infer(value)
    if kind is ParameterType.DOUBLE and type(plain) is int:
        return _double(plain)
    if kind is ParameterType.DOUBLE_ARRAY and isinstance(plain, list) and plain and type(plain[0]) is int:
        return [_double(item) for item in plain]
    if plain == [] and kind in ELEMENTS:
        return []
    if plain == [] and kind is ParameterType.BYTE_ARRAY:
        return b""
    found = kind_of(plain)
    if found is not kind:
        raise ParameterError(f"wrong type: expected {kind.label}, got {found.label}")
    return plain


def convert(text: str, kind: ParameterType, parse: Callable[[str], object]) -> Value:
    """What a person typed, as a value of `kind`; with NOT_SET whatever `parse` makes of it."""
    if kind is ParameterType.STRING:
        value = parse(text)
        return value if isinstance(value, str) else text
    if kind is ParameterType.BYTE_ARRAY:
        items = parse(text)
        if isinstance(items, list) and all(type(item) is int and 0 <= item < 256 for item in items):
            return bytes(items)
        return fit(items, kind)
    value = parse(text)
    return infer(value) if kind is ParameterType.NOT_SET else fit(value, kind)


def _plain(value: object) -> Any:
    if _is_numpy(value):
        value = cast("Any", value).tolist()
    if isinstance(value, bytearray | memoryview):
        return bytes(value)
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    for base in (bool, int, float, str):  # an IntEnum or a StrEnum counts as what it is
        if isinstance(value, base):
            return base(value)
    return value


def _is_numpy(value: object) -> bool:
    """Whether it is an array or a scalar of numpy's; where numpy was never loaded nothing is."""
    numpy = sys.modules.get("numpy")
    return numpy is not None and isinstance(value, numpy.ndarray | numpy.generic)


def _integer(value: Any) -> int:
    if value not in _INT64:
        raise ParameterError(f"{value} does not fit an integer of 64 bits")
    return int(value)


def _double(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number) or int(number) != value:
        raise ParameterError(f"{value} cannot be a double without loss")
    return number


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
