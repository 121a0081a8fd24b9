"""`@message`: an annotated Python class becomes a ROS 2 message type with a definition, a hash and a codec.

    @metaros.message
    class Battery:
        volts: float = 0.0
        cells: list[float32]

The class keeps its name, methods and annotations. It gets slots, a constructor by keywords, equality and a repr.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field as dataclass_field
from types import CellType, FunctionType
from typing import Any, TypeVar, dataclass_transform, overload

from metaros.errors import DefinitionError, FieldError
from metaros.idl.annotated_build import methods
from metaros.idl.annotated_fields import Plan, plan_fields
from metaros.idl.annotated_names import type_name
from metaros.idl.catalogue import Catalogue, default_catalogue
from metaros.idl.classes import Message, message_class
from metaros.idl.definitions import Field, MessageDefinition
from metaros.idl.known import remember
from metaros.idl.parser import parse_msg
from metaros.idl.schema import definition_text

__all__ = ["message"]

T = TypeVar("T")


@overload
def message(cls: type[T], /) -> type[T]:
    """`@message` alone."""


@overload
def message(*, name: str = "", catalogue: Catalogue | None = None) -> Callable[[type[T]], type[T]]:
    """`@message(name=…)`."""


@dataclass_transform(kw_only_default=True, field_specifiers=(dataclass_field,))
def message(cls: type[Any] | None = None, /, *, name: str = "", catalogue: Catalogue | None = None) -> Any:
    """Make a message class of an annotated class.

    `name` is the ROS name, such as "my_robot/msg/Battery"; without it the package is the class's top-level module (of
    a program its file's name) and the rest the class's name. `catalogue` is where others look it up by name.
    `FieldError` names the class and the field that has no ROS type.
    """
    around = sys._getframe(1).f_locals  # where names in annotations of a class inside a function are found
    base = default_catalogue() if catalogue is None else catalogue

    def decorate(found: type[Any]) -> type[Any]:
        return _make(found, name, base, around)

    return decorate if cls is None else decorate(cls)


def _make(cls: type[Any], name: str, base: Catalogue, around: Mapping[str, Any]) -> type[Any]:
    full = type_name(cls, name)
    plan = plan_fields(cls, around)
    definition = _checked(MessageDefinition(full, plan.fields, plan.constants), cls)
    own = Catalogue(base=base)
    nested = list(_nested(plan, base))
    try:
        own.add_all([definition, *(part for part, _ in nested)])
        for part, part_class in nested:
            _set_class(own, part.name, part_class)
        made = _build(cls, plan, definition, own)
        _set_class(own, full, made)
        made.__metaros_hash__ = remember(full, own)
    except DefinitionError as error:
        raise FieldError(f"{cls.__qualname__}: {error}") from None
    _publish(definition, made, nested, base)
    return made


def _nested(plan: Plan, base: Catalogue) -> Iterator[tuple[MessageDefinition, type[Any]]]:
    """Definition and class of each message inside, where the catalogue does not have that very class."""
    seen: set[str] = set()
    for outer in plan.nested:
        source: Catalogue = outer.__metaros_catalogue__
        for name in (outer.__metaros_name__, *source.dependencies(outer.__metaros_name__)):
            part = outer if name == outer.__metaros_name__ else message_class(name, source)
            if name not in seen and not _has(base, source.message(name), part):
                seen.add(name)
                yield source.message(name), part


def _has(base: Catalogue, definition: MessageDefinition, cls: type[Any]) -> bool:
    name = definition.name
    return name in base and base.get(name) == definition and message_class(name, base) is cls


def _publish(
    definition: MessageDefinition, made: type[Any], nested: list[tuple[MessageDefinition, type[Any]]], base: Catalogue
) -> None:
    """Let the catalogue know what it has no other definition of; the rest is found by name and hash."""
    wanted = [(definition, made), *nested]
    if any(item.name in base and base.get(item.name) != item for item, _ in wanted):
        return
    new = [(item, cls) for item, cls in wanted if item.name not in base]  # shipped types keep their shipped classes
    base.add_all([item for item, _ in new])
    for item, cls in new:
        _set_class(base, item.name, cls)


def _set_class(catalogue: Catalogue, name: str, cls: type[Any]) -> None:
    """Let the catalogue's codec of `name` make instances of `cls`, unless it has another class already."""
    catalogue.memo("class", name, lambda: cls)


def _checked(definition: MessageDefinition, cls: type[Any]) -> MessageDefinition:
    """The definition, once its text was seen to say the same: that is what others get."""
    text = definition_text(definition)
    try:
        same = definition_text(parse_msg(text, definition.name)) == text
    except DefinitionError as error:
        raise FieldError(f"{cls.__qualname__}: {str(error).partition(': ')[2] or error}") from None
    if not same:
        raise FieldError(f"{cls.__qualname__}: a default or a constant cannot be written in a .msg file")
    return definition


def _build(cls: type[Any], plan: Plan, definition: MessageDefinition, catalogue: Catalogue) -> type[Any]:
    kept = {name: value for name, value in vars(cls).items() if name not in ("__dict__", "__weakref__")}
    own = [item for item in definition.fields if item.attribute in plan.own]
    for item in own:
        kept.pop(item.attribute, None)
    factories = {**getattr(cls, "__metaros_factories__", {}), **plan.factories}
    body: dict[str, Any] = {
        "__slots__": tuple(item.attribute for item in own),
        "__hash__": None,
        "__repr__": _repr,
        "__metaros_name__": definition.name,
        "__metaros_catalogue__": catalogue,
        "__metaros_fields__": definition.fields,
        "__metaros_factories__": factories,
        "__doc__": cls.__doc__ or f"The message {definition.name}.",
    }
    inherited = set().union(*(getattr(item, "__metaros_held__", ()) for item in cls.__mro__))
    held = inherited | plan.holders.keys()
    body["__metaros_held__"] = frozenset(held)
    body |= methods(definition, catalogue, factories, held=held, after=hasattr(cls, "__post_init__"))
    explicit = {name: value for name, value in kept.items() if name not in ("__hash__", "__doc__")}
    if kept.get("__hash__") is not None:
        explicit["__hash__"] = kept["__hash__"]
    bases = tuple(Message if item is object else item for item in cls.__bases__)
    metaclass: Any = type(cls)
    made: type[Any] = metaclass(cls.__name__, bases, {**body, **explicit})
    for attribute, hold in plan.holders.items():
        setattr(made, attribute, _held(made, attribute, hold))
    _move_methods(cls, made)
    return made


def _held(cls: type[Any], attribute: str, hold: Callable[[Any], Any]) -> property:
    """The slot behind a setter; reading it costs what a slot costs."""
    slot = vars(cls)[attribute]
    put, where = slot.__set__, f"{cls.__qualname__}.{attribute}"

    def set_(instance: Any, value: Any) -> None:
        try:
            put(instance, hold(value))
        except (FieldError, TypeError, ValueError, OverflowError) as error:
            raise FieldError(f"{where}: {error}") from None

    return property(slot.__get__, set_)


def _move_methods(old: type[Any], new: type[Any]) -> None:
    """`super()` and `__class__` in methods mean the class they were compiled in: make that the new one."""
    for value in vars(new).values():
        for function in _functions(value):
            for cell in function.__closure__ or ():
                if _content(cell) is old:
                    cell.cell_contents = new


def _functions(value: Any) -> Iterator[FunctionType]:
    parts = (value, getattr(value, "__func__", None), *(getattr(value, part, None) for part in ("fget", "fset")))
    return (part for part in parts if isinstance(part, FunctionType))


def _content(cell: CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # empty still
        return None


def _repr(self: Any) -> str:
    fields: tuple[Field, ...] = self.__metaros_fields__
    values = (f"{item.attribute}={_shown(getattr(self, item.attribute))}" for item in fields)
    return f"{type(self).__qualname__}({', '.join(values)})"


def _shown(value: Any) -> str:
    if isinstance(value, bytes) and len(value) > 32:
        return f"<bytes[{len(value)}]>"
    if hasattr(value, "dtype"):
        return repr(value.tolist()) if value.size <= 32 else f"<{value.dtype}{list(value.shape)}>"
    return repr(value)
