"""From a Python annotation to the ROS type of a field and what Python holds in it; errors say what to write instead."""

from __future__ import annotations

import types
import typing
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from math import prod
from typing import Annotated, Any

from metaros.errors import FieldError
from metaros.idl import annotated_values as values
from metaros.idl.arrays import DTYPES
from metaros.idl.classes import Message
from metaros.idl.definitions import INTEGER_RANGES, FieldType
from metaros.idl.marks import Bounded, Exact, Fixed, Shape

__all__ = ["Mapped", "map_annotation"]

MAX_ELEMENTS = 2**24  # of a fixed array
MAX_BOUND = 2**31 - 1
_PLAIN = {bool: "bool", int: "int64", float: "float64", str: "string"}
_FITTING: dict[type[Any], tuple[str, ...]] = {
    bool: ("bool",),
    int: tuple(INTEGER_RANGES),
    float: ("float32", "float64"),
    str: ("string", "wstring"),
}


@dataclass(frozen=True, slots=True)
class Mapped:
    """A field's ROS type; `hold` turns what is assigned into what Python holds; `nested` is its message class."""

    kind: FieldType
    hold: Callable[[Any], Any] | None = None
    nested: type[Message] | None = None
    enum: type[Enum] | None = None


def map_annotation(hint: Any) -> Mapped:
    """The field that `hint` asks for; a `FieldError` says why there is none."""
    marks: tuple[Any, ...] = ()
    if typing.get_origin(hint) is Annotated:
        hint, marks = hint.__origin__, hint.__metadata__
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is bytes:
        return _bytes(marks)
    if origin is list or hint is list:
        return _sequence(arguments, marks)
    if origin is tuple or hint is tuple:
        return _tuple(arguments, marks)
    if _is_array(hint, origin):
        return _array(arguments, marks)
    return _single(hint, marks)


def _single(hint: Any, marks: tuple[Any, ...]) -> Mapped:
    _only(marks, (Exact, Bounded))
    exact, bound = _mark(marks, Exact), _mark(marks, Bounded)
    if isinstance(hint, type) and issubclass(hint, Message):
        if exact or bound:
            raise FieldError("a message takes neither Exact nor Bounded")
        return Mapped(FieldType(hint.__metaros_name__), nested=hint)
    enum = hint if isinstance(hint, type) and issubclass(hint, Enum) else None
    plain = _plain(hint, enum)
    base = exact.base if exact else _PLAIN[plain]
    if base not in _FITTING[plain]:
        raise FieldError(f"{plain.__name__} cannot be {base}; it can be {', '.join(_FITTING[plain])}")
    if bound and plain is not str:
        raise FieldError("Bounded is for str, bytes, lists and arrays")
    kind = FieldType(base, string_bound=_size(bound, MAX_BOUND) if bound else 0)
    return Mapped(kind, values.enum_holder(enum) if enum else None, enum=enum)


def _plain(hint: Any, enum: type[Enum] | None) -> type[Any]:
    """bool, int, float or str; for an enum what its members are."""
    if enum is not None:
        for plain in _PLAIN:
            if issubclass(enum, plain):
                return plain
        raise FieldError(f"the enum {enum.__name__} has no wire form: derive it from IntEnum or StrEnum")
    if hint in _PLAIN:
        found: type[Any] = hint
        return found
    raise FieldError(_why_not(hint))


def _bytes(marks: tuple[Any, ...]) -> Mapped:
    return Mapped(_sized(FieldType("uint8"), marks), values.hold_bytes)


def _sequence(arguments: tuple[Any, ...], marks: tuple[Any, ...]) -> Mapped:
    if not arguments:
        raise FieldError("a list needs the type of its elements: list[float]")
    element = _element(arguments[0])
    if element.enum is not None and element.kind.is_string:
        raise FieldError("a list of text enums cannot be held: use list[str]")
    hold = values.list_holder(element.enum) if element.kind.base in DTYPES else None
    return replace(element, kind=_sized(element.kind, marks), hold=hold)


def _tuple(arguments: tuple[Any, ...], marks: tuple[Any, ...]) -> Mapped:
    if not arguments or any(item != arguments[0] for item in arguments if item is not Ellipsis):
        raise FieldError("a tuple is of one numeric type: tuple[float, float, float] or tuple[float, ...]")
    element = _element(arguments[0])
    if element.kind.base not in DTYPES or element.enum:
        raise FieldError("a tuple is of numbers; for texts and messages use a list")
    if Ellipsis not in arguments:
        if marks:
            raise FieldError("the length of the tuple is written out: it takes no Bounded and no Fixed")
        marks = (Fixed(len(arguments)),)
    return replace(element, kind=_sized(element.kind, marks), hold=values.hold_tuple)


def _array(arguments: tuple[Any, ...], marks: tuple[Any, ...]) -> Mapped:
    _only(marks, (Shape, Bounded, Fixed))
    dtype = typing.get_args(arguments[1]) if len(arguments) > 1 else ()
    name = getattr(dtype[0], "__name__", "") if dtype else ""
    base = {"bool_": "bool", "bool": "bool"}.get(name, name)
    if base not in DTYPES or base in ("byte", "char"):
        raise FieldError(f"an array needs a dtype that ROS has, such as NDArray[np.float32], not {name or 'none'}")
    shape = _mark(marks, Shape)
    if shape is None:
        return Mapped(_sized(FieldType(base), marks))
    dims: tuple[int | None, ...] = shape.dims
    rows, rest = dims[0], prod(size for size in dims[1:] if size)
    bound = _mark(marks, Bounded)
    if rows is not None:
        if bound or _mark(marks, Fixed):
            raise FieldError("a Shape without None is fixed: it takes no Bounded and no Fixed")
        kind = FieldType(base, "fixed", _size(Fixed(rows * rest), MAX_ELEMENTS))
    elif bound:
        kind = FieldType(base, "bounded", _size(Bounded(bound.size * rest), MAX_BOUND))
    else:
        kind = FieldType(base, "unbounded")
    return Mapped(kind, values.shape_holder(base, dims))


def _element(hint: Any) -> Mapped:
    element = map_annotation(hint)
    if element.kind.array:
        raise FieldError("ROS has no sequence of sequences: put the inner one into a message, or use numpy and Shape")
    return element


def _sized(element: FieldType, marks: tuple[Any, ...]) -> FieldType:
    _only(marks, (Bounded, Fixed))
    bound, fixed = _mark(marks, Bounded), _mark(marks, Fixed)
    if bound and fixed:
        raise FieldError("Bounded and Fixed exclude each other")
    if fixed:
        return replace(element, array="fixed", capacity=_size(fixed, MAX_ELEMENTS))
    if bound:
        return replace(element, array="bounded", capacity=_size(bound, MAX_BOUND))
    return replace(element, array="unbounded")


def _size(mark: Bounded | Fixed, limit: int) -> int:
    size: object = mark.size
    if type(size) is not int or not 0 < size <= limit:
        raise FieldError(f"a size of {size!r}: it must be between 1 and {limit}")
    return size


def _mark(marks: tuple[Any, ...], kind: type[Any]) -> Any:
    """The innermost mark is a type's own, the outermost is what the user added last: that one counts."""
    found = [mark for mark in marks if isinstance(mark, kind)]
    return found[-1] if found else None


def _only(marks: tuple[Any, ...], allowed: tuple[type[Any], ...]) -> None:
    """Foreign annotations are left alone; ours must make sense where they stand."""
    for mark in marks:
        if isinstance(mark, (Exact, Bounded, Fixed, Shape)) and not isinstance(mark, allowed):
            names = " and ".join(kind.__name__ for kind in allowed)
            raise FieldError(f"{type(mark).__name__} has no meaning here, where only {names} have")


def _is_array(hint: Any, origin: Any) -> bool:
    kind = origin or hint
    return isinstance(kind, type) and kind.__module__ == "numpy" and kind.__name__ == "ndarray"


def _why_not(hint: Any) -> str:
    """What to write instead of an annotation that has no ROS type."""
    name = hint.__name__ if isinstance(hint, type) else str(hint).replace("typing.", "")
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        return f"{name}: ROS fields always have a value of one type; use a bool beside it, or a list of at most one"
    if hint in (dict, set) or origin in (dict, set):
        return f"{name} has no ROS type: use a list of messages, or publish a plain dict"
    if hint in (Any, object):
        return f"{name} says nothing about the type: name one"
    if isinstance(hint, type) and hint.__module__ == "numpy":
        return f"numpy.{name} is for arrays; for one value use metaros.{name}"
    if isinstance(hint, type) and hasattr(hint, "__annotations__"):
        return f"{name} is no message class: decorate it with @metaros.message first"
    return f"{name} has no ROS type"
