"""Where annotated classes are found: in catalogues of their own, and in the program's by their names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from metaros.errors import DefinitionError, FieldError
from metaros.idl.annotated_fields import Plan
from metaros.idl.catalogue import Catalogue
from metaros.idl.classes import message_class
from metaros.idl.definitions import Definition, MessageDefinition
from metaros.idl.parser import parse_msg
from metaros.idl.schema import definition_text

__all__ = ["checked", "nested_parts", "publish", "set_class"]


def nested_parts(plan: Plan, base: Catalogue) -> Iterator[tuple[MessageDefinition, type[Any]]]:
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


def publish(
    definition: Definition,
    classes: Mapping[str, type[Any]],
    nested: Iterable[tuple[MessageDefinition, type[Any]]],
    base: Catalogue,
) -> None:
    """Let the catalogue know what it has no other definition of; the rest is found by name and hash.

    `classes` are those that the definition brings: its own, and those of a service's or an action's parts.
    """
    wanted: dict[str, Definition] = {definition.name: definition, **{item.name: item for item, _ in nested}}
    if any(name in base and base.get(name) != item for name, item in wanted.items()):
        return
    new = [item for name, item in wanted.items() if name not in base]  # shipped types keep their shipped classes
    base.add_all(new)
    names = {item.name for item in new}
    for item, cls in nested:
        if item.name in names:
            set_class(base, item.name, cls)
    if definition.name in names:
        for name, cls in classes.items():
            set_class(base, name, cls)


def set_class(catalogue: Catalogue, name: str, cls: type[Any]) -> None:
    """Let the catalogue's codec of `name` make instances of `cls`, unless it has another class already."""
    catalogue.memo("class", name, lambda: cls)


def checked(definition: MessageDefinition, cls: type[Any]) -> MessageDefinition:
    """The definition, once its text was seen to say the same: that is what others get."""
    text = definition_text(definition)
    try:
        same = definition_text(parse_msg(text, definition.name)) == text
    except DefinitionError as error:
        raise FieldError(f"{cls.__qualname__}: {str(error).partition(': ')[2] or error}") from None
    if not same:
        raise FieldError(f"{cls.__qualname__}: a default or a constant cannot be written in a .msg file")
    return definition
