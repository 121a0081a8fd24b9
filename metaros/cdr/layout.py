"""How primitives lie in XCDR1, and what a code generator knows about the position it has reached."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from metaros.errors import DefinitionError
from metaros.idl import Catalogue, FieldType

__all__ = ["CODES", "HEADER_BYTES", "Order", "Position", "check_size", "size_of"]

HEADER_BYTES = 4
Order: TypeAlias = Literal["<", ">"]
MAX_INLINED_FIELDS = 20_000
MAX_DEPTH = 32

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
    """Refuse a type so large or deep that its inlined code would be: `DefinitionError`."""
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
