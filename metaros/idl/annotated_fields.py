"""The fields, constants and defaults of a `@message` class, read from its annotations."""

from __future__ import annotations

import dataclasses
import inspect
import math
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ClassVar, cast

from metaros.errors import FieldError
from metaros.idl.annotated_names import field_name, is_constant_name
from metaros.idl.annotated_types import Mapped, map_annotation
from metaros.idl.classes import Message, message_class
from metaros.idl.definitions import INTEGER_RANGES, Constant, Field, FieldType

__all__ = ["Plan", "plan_fields"]

_NOTHING = cast("Any", dataclasses.MISSING)


@dataclass(slots=True)
class Plan:
    """What is to be built; `own` are the attributes of this class, the rest is inherited."""

    fields: tuple[Field, ...] = ()
    constants: tuple[Constant, ...] = ()
    own: list[str] = field(default_factory=list)
    factories: dict[str, Callable[[], Any]] = field(default_factory=dict)
    holders: dict[str, Callable[[Any], Any]] = field(default_factory=dict)
    nested: list[type[Message]] = field(default_factory=list)


def plan_fields(cls: type[Any], around: Mapping[str, Any]) -> Plan:
    """The plan of a class; `around` has the names that its annotations may use beside those of its module."""
    _check_class(cls)
    plan = Plan()
    for base in reversed(cls.__mro__[1:]):
        if "__metaros_fields__" in vars(base) and base is not Message:
            _inherit(plan, base)
    for attribute, hint in _annotations(cls, around).items():
        where = f"{cls.__qualname__}.{attribute}"
        try:
            if hint is ClassVar or typing.get_origin(hint) is ClassVar:
                _add_constant(plan, cls, attribute, hint)
            else:
                _add_field(plan, cls, attribute, hint)
        except FieldError as error:
            raise FieldError(f"{where}: {error}") from None
    return plan


def _check_class(cls: Any) -> None:
    if not isinstance(cls, type):
        raise FieldError(f"@message is for classes, not for {cls!r}")
    trouble = ""
    if "__metaros_fields__" in vars(cls):
        trouble = "it is a message class already"
    elif issubclass(cls, Enum) or issubclass(cls, (tuple, list, dict, str, int, float, bytes)):
        trouble = f"a class derived from {cls.__mro__[1].__name__} cannot be a message"
    elif dataclasses.is_dataclass(cls):
        trouble = "use @metaros.message alone, without @dataclass"
    elif "__slots__" in vars(cls):
        trouble = "leave __slots__ out: @message makes them"
    elif getattr(cls, "__parameters__", ()):
        trouble = "a generic class has no fixed fields"
    if trouble:
        raise FieldError(f"{cls.__qualname__}: {trouble}")


def _inherit(plan: Plan, base: type[Any]) -> None:
    definition = base.__metaros_catalogue__.message(base.__metaros_name__)
    present = {item.name for item in plan.fields}
    plan.fields += tuple(item for item in definition.fields if item.name not in present)
    plan.constants += tuple(item for item in definition.constants if item not in plan.constants)
    for item in definition.fields:
        if item.type.is_nested:
            plan.nested.append(message_class(item.type.base, base.__metaros_catalogue__))


def _annotations(cls: type[Any], around: Mapping[str, Any]) -> dict[str, Any]:
    """The class's own annotations, texts evaluated."""
    holder = type(
        cls.__name__, (), {"__annotations__": dict(inspect.get_annotations(cls)), "__module__": cls.__module__}
    )
    inside = {name: value for name, value in vars(cls).items() if isinstance(value, type)}
    try:
        return typing.get_type_hints(holder, localns={**around, **inside, cls.__name__: cls}, include_extras=True)
    except NameError as error:
        raise FieldError(f"{cls.__qualname__}: an annotation names {error.name!r}, which is not defined here") from None
    except (TypeError, SyntaxError, AttributeError) as error:
        raise FieldError(f"{cls.__qualname__}: an annotation cannot be evaluated: {error}") from None


def _add_field(plan: Plan, cls: type[Any], attribute: str, hint: Any) -> None:
    name = field_name(attribute)
    if any(item.name == name for item in plan.fields):
        raise FieldError("a base class has a field of this name")
    if _mentions(hint, cls):
        raise FieldError(f"{cls.__name__} contains itself: ROS messages have no recursion")
    mapped = map_annotation(hint)
    value, factory = _default(vars(cls).get(attribute, _NOTHING), mapped)
    literal = None if value is _NOTHING else _literal(mapped, value)
    plan.fields += (Field(name, mapped.kind, literal),)
    plan.own.append(attribute)
    if factory is not None:
        plan.factories[attribute] = factory
    elif value is not _NOTHING:
        held = mapped.hold(value) if mapped.hold else value
        plan.factories[attribute] = lambda: held
    if mapped.hold is not None:
        plan.holders[attribute] = mapped.hold
    if mapped.nested is not None:
        plan.nested.append(mapped.nested)
    if mapped.enum is not None:
        _name_members(plan, name, mapped)


def _mentions(hint: Any, cls: type[Any]) -> bool:
    return hint is cls or any(_mentions(item, cls) for item in typing.get_args(hint))


def _default(value: Any, mapped: Mapped) -> tuple[Any, Callable[[], Any] | None]:
    """The default value, or the function that makes it."""
    if isinstance(value, dataclasses.Field):
        if value.default_factory is not _NOTHING:
            factory = cast("Callable[[], Any]", value.default_factory)
            return _NOTHING, factory
        value = value.default
    if value is _NOTHING:
        if mapped.enum is not None and not mapped.kind.array:
            return next(iter(mapped.enum)), None
        return _NOTHING, None
    if isinstance(value, (list, dict, set, bytearray, Message)) or hasattr(value, "dtype"):
        raise FieldError("the default could be changed: write dataclasses.field(default_factory=lambda: …)")
    return value, None


def _literal(mapped: Mapped, value: Any) -> Any:
    """A default as the definition holds it, None for what only Python can say; `FieldError` when it does not fit."""
    kind = mapped.kind
    if kind.is_nested:
        raise FieldError("a message's default is made anew each time: dataclasses.field(default_factory=…)")
    if not kind.array:
        plain = _scalar(kind, value)
        return plain if _is_writable(plain) else None
    if not isinstance(value, (tuple, bytes)):
        raise FieldError(f"the default {value!r} is no tuple")
    values = [_scalar(kind.element, item) for item in value]
    return values if values and all(map(_is_writable, values)) else None


def _is_writable(value: Any) -> bool:
    """Whether every reader of .msg texts understands it: not all know nan and inf."""
    return not isinstance(value, float) or math.isfinite(value)


def _scalar(kind: FieldType, value: Any) -> Any:
    if kind.is_string and isinstance(value, str):
        return str(value.value if isinstance(value, Enum) else value)
    if kind.base == "bool" and isinstance(value, bool):
        return value
    if kind.base in ("float32", "float64") and isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    if kind.base in INTEGER_RANGES and isinstance(value, int) and not isinstance(value, bool):
        return int(value)
    raise FieldError(f"the default {value!r} does not fit {kind.text()}")


def _add_constant(plan: Plan, cls: type[Any], name: str, hint: Any) -> None:
    """An upper-case ClassVar is a constant; any other belongs to Python alone."""
    if not is_constant_name(name):
        return
    value = vars(cls).get(name, _NOTHING)
    if value is _NOTHING:
        raise FieldError("a constant needs a value")
    inner = typing.get_args(hint)
    mapped = map_annotation(inner[0] if inner else type(value))
    if mapped.kind.array or mapped.kind.is_nested:
        raise FieldError("a constant is a number, a bool or a text")
    plan.constants += (Constant(name, mapped.kind, _scalar(mapped.kind, value)),)


def _name_members(plan: Plan, field: str, mapped: Mapped) -> None:
    """An enum's members become constants, by which viewers show their names."""
    assert mapped.enum is not None
    known = {item.name for item in plan.constants}
    for member in mapped.enum:
        name = f"{field}_{member.name}".upper()
        if is_constant_name(name) and name not in known:
            plan.constants += (Constant(name, mapped.kind.element, _scalar(mapped.kind.element, member)),)
