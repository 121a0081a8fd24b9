"""The fields of a message as ROS 2's tools describe them: `SLOT_TYPES` and `_fields_and_field_types`."""

from __future__ import annotations

from metaros.idl.definitions import Field, FieldType
from metaros.ros2.rosidl.parser import definition as parser

__all__ = ["field_texts", "slot_types"]

_WORDS = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float", "float64": "double"}


def slot_types(fields: tuple[Field, ...]) -> tuple[parser.AbstractType, ...]:
    """The types of the fields, in order."""
    return tuple(_slot_type(field.type) for field in fields)


def field_texts(fields: tuple[Field, ...]) -> dict[str, str]:
    """The fields' types in words, by name: {"data": "sequence<uint8>"}. Parts of services stand without "srv/"."""
    texts = {}
    for field in fields:
        text = field.type.text(slots=True)
        texts[field.name] = text.replace("/srv/", "/").replace("/action/", "/") if field.type.is_nested else text
    return texts


def _slot_type(kind: FieldType) -> parser.AbstractType:
    single = _single(kind)
    if kind.array == "fixed":
        return parser.Array(single, kind.capacity)
    if kind.array == "bounded":
        return parser.BoundedSequence(single, kind.capacity)
    return parser.UnboundedSequence(single) if kind.array else single


def _single(kind: FieldType) -> parser.AbstractNestableType:
    if kind.is_nested:
        *namespaces, name = kind.base.split("/")
        return parser.NamespacedType(namespaces, name)
    if kind.base == "string":
        return parser.BoundedString(kind.string_bound) if kind.string_bound else parser.UnboundedString()
    if kind.base == "wstring":
        return parser.BoundedWString(kind.string_bound) if kind.string_bound else parser.UnboundedWString()
    return parser.BasicType(_WORDS.get(kind.base, kind.base))
