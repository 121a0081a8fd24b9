"""`Annotated[…]` markers for `@message` classes: exact ROS types, bounds and shapes, all invisible to type checkers.

speed: float32
name: Annotated[str, Bounded(20)]
codes: Annotated[list[uint8], Bounded(8)]
pose: Annotated[NDArray[np.float64], Shape(4, 4)]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, TypeAlias

from metaros.errors import FieldError

__all__ = [
    "Bounded",
    "Exact",
    "Fixed",
    "Shape",
    "byte",
    "char",
    "float32",
    "float64",
    "int8",
    "int16",
    "int32",
    "int64",
    "uint8",
    "uint16",
    "uint32",
    "uint64",
    "wstring",
]


@dataclass(frozen=True, slots=True)
class Exact:
    """This very ROS primitive, such as `Annotated[Mode, Exact("uint8")]` for an IntEnum."""

    base: str


@dataclass(frozen=True, slots=True)
class Bounded:
    """At most `size` elements, or for a `str` bytes of UTF-8."""

    size: int


@dataclass(frozen=True, slots=True)
class Fixed:
    """Exactly `size` elements."""

    size: int


@dataclass(frozen=True, slots=True, init=False)
class Shape:
    """The shape of a numpy field. None, as the first dimension only, stands for any number."""

    dims: tuple[int | None, ...]

    def __init__(self, *dims: int | None) -> None:
        sizes = dims[1:] if dims and dims[0] is None else dims
        if not dims or not all(type(size) is int and size > 0 for size in sizes):
            raise FieldError(f"Shape{dims}: dimensions are whole numbers above 0; only the first may be None")
        object.__setattr__(self, "dims", dims)


byte: TypeAlias = Annotated[int, Exact("byte")]
char: TypeAlias = Annotated[int, Exact("char")]
int8: TypeAlias = Annotated[int, Exact("int8")]
uint8: TypeAlias = Annotated[int, Exact("uint8")]
int16: TypeAlias = Annotated[int, Exact("int16")]
uint16: TypeAlias = Annotated[int, Exact("uint16")]
int32: TypeAlias = Annotated[int, Exact("int32")]
uint32: TypeAlias = Annotated[int, Exact("uint32")]
int64: TypeAlias = Annotated[int, Exact("int64")]
uint64: TypeAlias = Annotated[int, Exact("uint64")]
float32: TypeAlias = Annotated[float, Exact("float32")]
float64: TypeAlias = Annotated[float, Exact("float64")]
wstring: TypeAlias = Annotated[str, Exact("wstring")]
