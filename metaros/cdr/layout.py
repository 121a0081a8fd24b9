"""How primitives lie in XCDR1, and what a code generator knows about the position it has reached."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from metaros.errors import DefinitionError
from metaros.idl import Catalogue, FieldType, MessageDefinition
from metaros.idl.derived import derived_definitions

__all__ = ["CODES", "HEADER_BYTES", "Order", "Position", "check_size", "least_bytes", "size_of"]

HEADER_BYTES = 4
Order: TypeAlias = Literal["<", ">"]
MAX_INLINED_FIELDS = 20_000
MAX_DEPTH = 32
MAX_FIXED_OBJECTS = 1 << 17  # messages and texts in arrays of fixed size, those in each other multiplied
MAX_FIXED_BYTES = 1 << 27  # numbers in arrays of fixed size, likewise
OBJECT_BYTES = 100

CODES: dict[str, str] = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
_SIZES = {"?": 1, "b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4, "f": 4, "q": 8, "Q": 8, "d": 8}


def size_of(base: str) -> int:
    """Bytes of a primitive; also its alignment."""
    return _SIZES[CODES[base]]


@dataclass(frozen=True, slots=True)
class Position:
    """What is known of a position in the body: it is `residue` modulo `modulus` (1, 2, 4 or 8)."""

    modulus: int = 8
    residue: int = 0

    def after(self, size: int) -> Position:
        """The position `size` bytes later."""
        return Position(self.modulus, (self.residue + size) % self.modulus)

    def gap(self, alignment: int) -> int | None:
        """Padding up to `alignment`, or None if it depends on the data."""
        return -self.residue % alignment if alignment <= self.modulus else None

    def meet(self, other: Position) -> Position:
        """What holds whether one comes from here or from `other`."""
        modulus = min(self.modulus, other.modulus)
        while (self.residue - other.residue) % modulus:
            modulus //= 2
        return Position(modulus, self.residue % modulus)


def check_size(name: str, catalogue: Catalogue) -> None:
    """Refuse a type so large or deep that its inlined code would be: `DefinitionError`.

    Of a service or an action all messages that belong to it are looked at.
    """
    definition = catalogue.get(name)
    parts = {name: definition} if isinstance(definition, MessageDefinition) else derived_definitions(definition)
    for part, found in parts.items():
        if isinstance(found, MessageDefinition):
            _check_message(part, catalogue)


def _check_message(name: str, catalogue: Catalogue) -> None:
    counts: dict[str, int] = {}

    def count(kind: FieldType, depth: int) -> int:
        if depth > MAX_DEPTH:
            raise DefinitionError(f"{name} nests messages deeper than {MAX_DEPTH}")
        if not kind.is_nested:
            return 1
        if kind.base not in counts or depth + 1 > MAX_DEPTH // 2:
            total = sum(count(field.type, depth + 1) for field in catalogue.message(kind.base).fields)
            counts[kind.base] = 1 + total
        if counts[kind.base] > MAX_INLINED_FIELDS:
            raise DefinitionError(f"{name} has more than {MAX_INLINED_FIELDS} fields, those of its parts counted")
        return counts[kind.base]

    catalogue.dependencies(name)
    count(FieldType(name), 0)
    objects, size_bytes = _fixed(FieldType(name), catalogue, {})
    if objects > MAX_FIXED_OBJECTS or size_bytes > MAX_FIXED_BYTES:
        raise DefinitionError(
            f"{name} has arrays of fixed size that make every message {objects} objects and {size_bytes} bytes;"
            f" at most {MAX_FIXED_OBJECTS} and {MAX_FIXED_BYTES} are possible"
        )


def least_bytes(name: str, catalogue: Catalogue) -> int:
    """What a message of this type takes in memory, about, when nothing is set: its arrays of fixed size."""
    objects, size_bytes = _fixed(FieldType(name), catalogue, {})
    return OBJECT_BYTES * objects + size_bytes


def _fixed(kind: FieldType, catalogue: Catalogue, known: dict[str, tuple[int, int]]) -> tuple[int, int]:
    """Objects and bytes of numbers of a value that was left out; the type is known to end."""
    if kind.is_sequence:
        return 0, 0
    times = kind.capacity if kind.array else 1
    if not kind.is_nested:
        return (times, 0) if kind.is_string else (0, times * size_of(kind.base))
    if kind.base not in known:
        parts = [_fixed(field.type, catalogue, known) for field in catalogue.message(kind.base).fields]
        known[kind.base] = 1 + sum(part[0] for part in parts), sum(part[1] for part in parts)
    objects, size_bytes = known[kind.base]
    return times * objects, times * size_bytes
