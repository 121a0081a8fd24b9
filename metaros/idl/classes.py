"""Python classes for interfaces, generated from their definitions: slots, keyword constructor, equality, repr."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

from metaros.errors import FieldError
from metaros.idl.arrays import DTYPES, as_array, same_values
from metaros.idl.catalogue import Catalogue, default_catalogue
from metaros.idl.definitions import ActionDefinition, Field, FieldType, MessageDefinition, ServiceDefinition
from metaros.idl.hashing import type_hash
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")

__all__ = ["Action", "Message", "Service", "equality_source", "maker", "message_class", "reject_unknown", "zero"]

_REPR_ITEMS = 32


class Message:
    """The base of all message classes."""

    __slots__ = ()
    __metaros_name__: ClassVar[str]
    __metaros_hash__: ClassVar[str]
    __metaros_catalogue__: ClassVar[Catalogue]
    __metaros_fields__: ClassVar[tuple[Field, ...]]

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """The fields in order, with their types as rclpy spells them."""
        return {field.name: field.type.text(slots=True) for field in cls.__metaros_fields__}

    def __repr__(self) -> str:
        values = (f"{field.attribute}={_shown(getattr(self, field.attribute))}" for field in self.__metaros_fields__)
        return f"{self.__metaros_name__.replace('/', '.')}({', '.join(values)})"


class Service:
    """The base of all service classes: a namespace, never instantiated."""

    __metaros_name__: ClassVar[str]
    __metaros_hash__: ClassVar[str]
    Request: ClassVar[type[Any]]
    Response: ClassVar[type[Any]]
    Event: ClassVar[type[Any]]


class Action:
    """The base of all action classes: a namespace, never instantiated."""

    __metaros_name__: ClassVar[str]
    __metaros_hash__: ClassVar[str]
    Goal: ClassVar[type[Any]]
    Result: ClassVar[type[Any]]
    Feedback: ClassVar[type[Any]]


def message_class(name: str, catalogue: Catalogue | None = None) -> type[Any]:
    """The class of the interface `name`: made once for a catalogue, then always the same object.

    For a service it has `.Request`, `.Response` and `.Event`, for an action `.Goal`, `.Result` and `.Feedback`.
    """
    home = (catalogue or default_catalogue()).home(name)
    return home.memo("class", name, lambda: (home.shape.make or _make)(name, home))


def _make(name: str, catalogue: Catalogue) -> type[Any]:
    definition = catalogue.get(name)
    catalogue.dependencies(name)
    if isinstance(definition, MessageDefinition):
        return _make_message(definition, catalogue)
    if isinstance(definition, ServiceDefinition):
        return _make_namespace(definition, catalogue, Service, ("Request", "Response", "Event"))
    return _make_namespace(definition, catalogue, Action, ("Goal", "Result", "Feedback"))


def _make_namespace(
    definition: ServiceDefinition | ActionDefinition, catalogue: Catalogue, base: type[Any], parts: tuple[str, ...]
) -> type[Any]:
    members: dict[str, Any] = {part: message_class(f"{definition.name}_{part}", catalogue) for part in parts}
    return type(definition.name.split("/")[2], (base,), members | _identity(definition.name, catalogue))


def _identity(name: str, catalogue: Catalogue) -> dict[str, Any]:
    package, kind, short = name.split("/")
    return {
        "__module__": f"metaros.interfaces.{package}.{kind}",
        "__qualname__": short,
        "__doc__": f"The interface {name}.",
        "__metaros_name__": name,
        "__metaros_hash__": type_hash(name, catalogue),
        "__metaros_catalogue__": catalogue,
    }


def _make_message(definition: MessageDefinition, catalogue: Catalogue) -> type[Any]:
    scope: dict[str, Any] = {"_as_array": as_array, "_same": same_values, "_reject": reject_unknown}
    source = "\n".join([*_constructor(definition.fields, catalogue, scope), *equality_source(definition.fields)])
    exec(compile(source, f"<{definition.name}>", "exec"), scope)
    members: dict[str, Any] = {
        "__slots__": tuple(field.attribute for field in definition.fields),
        "__metaros_fields__": definition.fields,
        "__init__": scope["__init__"],
        "__eq__": scope["__eq__"],
        "__hash__": None,
        **{constant.name: constant.value for constant in definition.constants},
        **_identity(definition.name, catalogue),
    }
    return type(definition.name.split("/")[2], (Message,), members)


def _constructor(fields: tuple[Field, ...], catalogue: Catalogue, scope: dict[str, Any]) -> list[str]:
    """An `__init__` as one would write it by hand: a parameter and an assignment a field."""
    parameters, body = [], ["if _unknown: _reject(_self, _unknown)"]
    for number, field in enumerate(fields):
        name, default = field.attribute, f"_d{number}"
        if field.type.is_nested or field.type.array:
            parameters.append(f"{name}=None")
            given = name
            if field.type.base in DTYPES and field.type.array:
                given = f"_as_array({name}, {field.type.base!r})"
            scope[default] = maker(field.type, field.default, catalogue)
            body.append(f"_self.{name} = {default}() if {name} is None else {given}")
        else:
            scope[default] = zero(field.type) if field.default is None else field.default
            parameters.append(f"{name}={default}")
            body.append(f"_self.{name} = {name}")
    star = ["*"] if parameters else []
    return [
        f"def __init__(_self, {', '.join([*star, *parameters, '**_unknown'])}):",
        *(f"    {line}" for line in body),
    ]


def equality_source(fields: tuple[Field, ...]) -> list[str]:
    """The lines of an `__eq__`, which calls `_same` for arrays of numbers."""
    tests = ["True"]
    for field in fields:
        name = field.attribute
        if field.type.array and field.type.base in DTYPES:
            tests.append(f"_same(_self.{name}, _other.{name})")
        else:
            tests.append(f"_self.{name} == _other.{name}")
    return [
        "def __eq__(_self, _other):",
        "    if _other.__class__ is not _self.__class__:",
        "        return NotImplemented",
        f"    return {' and '.join(tests)}",
    ]


def zero(kind: FieldType) -> Any:
    """The value of a primitive that nobody set."""
    if kind.is_string:
        return ""
    if kind.base == "bool":
        return False
    return 0.0 if kind.base in ("float32", "float64") else 0


def maker(kind: FieldType, default: Any, catalogue: Catalogue) -> Callable[[], Any]:
    """A function without arguments that makes the default value of an array or a nested field."""
    count = kind.capacity if kind.array == "fixed" else 0
    if kind.is_nested:
        element = message_class(kind.base, catalogue)
        return (lambda: [element() for _ in range(count)]) if kind.array else element
    if kind.is_string:
        texts = list(default) if default is not None else [""] * count
        return texts.copy
    values = np.zeros(count, DTYPES[kind.base]) if default is None else as_array(default, kind.base)
    if not len(values):
        values.flags.writeable = False
        return lambda: values
    return values.copy


def reject_unknown(message: Message, unknown: dict[str, Any]) -> None:
    """Say which keyword of a constructor is no field."""
    known = ", ".join(field.attribute for field in message.__metaros_fields__) or "none"
    raise FieldError(f"{message.__metaros_name__} has no field {min(unknown)!r}; its fields are: {known}")


def _shown(value: Any) -> str:
    if hasattr(value, "dtype"):
        return repr(value.tolist()) if value.size <= _REPR_ITEMS else f"<{value.dtype}[{value.size}]>"
    return repr(value)
