"""`@message`: an annotated Python class becomes a ROS 2 message type with a definition, a hash and a codec.

    @metaros.message
    class Battery:
        volts: float = 0.0
        cells: list[float32]

The class keeps its name, methods and annotations. It gets slots, a constructor by keywords, equality and a repr.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import field as dataclass_field
from typing import Any, TypeVar, dataclass_transform, overload

from metaros.errors import DefinitionError, FieldError
from metaros.idl.annotated_build import build_class
from metaros.idl.annotated_fields import plan_fields
from metaros.idl.annotated_home import checked, nested_parts, publish, set_class
from metaros.idl.annotated_names import type_name
from metaros.idl.catalogue import Catalogue, default_catalogue
from metaros.idl.definitions import MessageDefinition
from metaros.idl.known import remember

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
    definition = checked(MessageDefinition(full, plan.fields, plan.constants), cls)
    own = Catalogue(base=base)
    nested = list(nested_parts(plan, base))
    try:
        own.add_all([definition, *(part for part, _ in nested)])
        for part, part_class in nested:
            set_class(own, part.name, part_class)
        made = build_class(cls, plan, definition, own)
        set_class(own, full, made)
        made.__metaros_hash__ = remember(full, own)
    except DefinitionError as error:
        raise FieldError(f"{cls.__qualname__}: {error}") from None
    publish(definition, {full: made}, nested, base)
    return made
