"""Types as rosapi describes them: one `typedef` a message, the asked one first, then those that it is made of."""

from __future__ import annotations

from typing import Any

from metaros.idl import Catalogue, MessageDefinition
from metaros.idl.definitions import Field, FieldType

__all__ = ["typedefs"]

MAX_TYPEDEFS = 256


def typedefs(name: str, catalogue: Catalogue) -> list[dict[str, Any]]:
    """Of a message, or a part of a service or action; UnknownTypeError."""
    catalogue.message(name)
    several = [name, *sorted(catalogue.dependencies(name))][:MAX_TYPEDEFS]
    return [_typedef(catalogue.message(one)) for one in several]


def _typedef(definition: MessageDefinition) -> dict[str, Any]:
    fields = definition.fields
    return {
        "type": definition.name,
        "fieldnames": [field.name for field in fields],
        "fieldtypes": [field.type.base for field in fields],
        "fieldarraylen": [_length(field.type) for field in fields],
        "examples": [_example(field) for field in fields],
        "constnames": [item.name for item in definition.constants],
        "constvalues": [str(item.value) for item in definition.constants],
    }


def _length(kind: FieldType) -> int:
    """-1: no array; 0: of any length."""
    if not kind.array:
        return -1
    return kind.capacity if kind.array == "fixed" else 0


def _example(field: Field) -> str:
    kind = field.type
    if kind.array:
        return "[]"
    if kind.is_nested:
        return "{}"
    if field.default is not None:
        return str(field.default)
    if kind.is_string:
        return ""
    return "False" if kind.base == "bool" else ("0.0" if kind.base.startswith("float") else "0")
