"""From interface definitions to C: which structs, in which order, with which members. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from metaros.errors import DefinitionError
from metaros.idl import Catalogue, Constant, Field, MessageDefinition, ServiceDefinition

__all__ = ["NUMBERS", "Member", "Struct", "structs_of"]

NUMBERS: Final = {
    "bool": ("bool", 1),
    "byte": ("uint8_t", 1),
    "char": ("uint8_t", 1),
    "int8": ("int8_t", 1),
    "uint8": ("uint8_t", 1),
    "int16": ("int16_t", 2),
    "uint16": ("uint16_t", 2),
    "int32": ("int32_t", 4),
    "uint32": ("uint32_t", 4),
    "int64": ("int64_t", 8),
    "uint64": ("uint64_t", 8),
    "float32": ("float", 4),
    "float64": ("double", 8),
}
_KEYWORDS: Final = frozenset(
    [
        "auto",
        "break",
        "case",
        "char",
        "const",
        "continue",
        "default",
        "do",
        "double",
        "else",
        "enum",
        "extern",
        "float",
        "for",
        "goto",
        "if",
        "inline",
        "int",
        "long",
        "register",
        "restrict",
        "return",
        "short",
        "signed",
        "sizeof",
        "static",
        "struct",
        "switch",
        "typedef",
        "union",
        "unsigned",
        "void",
        "volatile",
        "while",
        "bool",
        "true",
        "false",
    ]
)


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a struct. `capacity`: the most elements, as C; "" for one value. `counted`: `<name>_count` says how
    many there are. `text_size`: bytes of a text with its end, as C."""

    name: str
    base: str
    c_type: str
    capacity: str = ""
    counted: bool = False
    text_size: str = ""


@dataclass(frozen=True, slots=True)
class Struct:
    """One message in C."""

    name: str
    ros_name: str
    members: tuple[Member, ...]
    constants: tuple[Constant, ...]


def structs_of(type_names: Iterable[str], catalogue: Catalogue) -> list[Struct]:
    """The structs of these types and of all that they contain, each after what it needs. Raises UnknownTypeError, or
    DefinitionError for what C cannot have (wide strings).
    """
    found: dict[str, Struct] = {}
    for name in type_names:
        for definition in _messages(name, catalogue):
            _add(definition, catalogue, found)
    return list(found.values())


def _messages(name: str, catalogue: Catalogue) -> tuple[MessageDefinition, ...]:
    definition = catalogue.get(name)
    if isinstance(definition, MessageDefinition):
        return (definition,)
    if isinstance(definition, ServiceDefinition):
        return definition.request, definition.response
    raise DefinitionError(f"{name} is an action: name its parts, such as {name}_Goal")


def _add(definition: MessageDefinition, catalogue: Catalogue, found: dict[str, Struct]) -> None:
    if definition.name in found:
        return
    for field in definition.fields:
        if field.type.is_nested:
            _add(catalogue.message(field.type.base), catalogue, found)
    members = tuple(_member(definition.name, field) for field in definition.fields)
    found[definition.name] = Struct(c_name(definition.name), definition.name, members, definition.constants)


def c_name(ros_name: str) -> str:
    """`geometry_msgs/msg/Twist` as `geometry_msgs_Twist`; parts of services keep their kind."""
    package, kind, name = ros_name.split("/")
    return f"{package}_{name}" if kind == "msg" else f"{package}_{kind}_{name}"


def _member(owner: str, field: Field) -> Member:
    kind = field.type
    if kind.base == "wstring":
        raise DefinitionError(f"{owner}: {field.name} is a wide string, which the C header does not have")
    name = f"{field.name}_" if field.name in _KEYWORDS else field.name
    c_type = c_name(kind.base) if kind.is_nested else "char" if kind.is_string else NUMBERS[kind.base][0]
    text_size = ""
    if kind.is_string:
        text_size = str(kind.string_bound + 1) if kind.string_bound else "METAROS_STRING_BYTES"
    capacity = ""
    if kind.array:
        capacity = str(kind.capacity) if kind.array in ("fixed", "bounded") else "METAROS_SEQUENCE_MAX"
    return Member(name, kind.base, c_type, capacity, kind.is_sequence, text_size)
