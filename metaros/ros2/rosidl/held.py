"""What message fields of ROS 2 programs hold: `array.array` for sequences of numbers, numpy for arrays of fixed size.

A decoder leaves views of the received bytes in the fields; they become what programs expect when they are first read.
"""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING, Any

from metaros.idl.arrays import DTYPES, TYPE_CODES, same_values
from metaros.idl.definitions import Field, FieldType
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")

__all__ = ["fixed_array", "is_converted", "is_numbers", "listed", "same", "sequence", "store", "writable"]

_OCTETS = tuple(bytes((value,)) for value in range(256))


def is_numbers(kind: FieldType) -> bool:
    """Whether it is an array or a sequence that is no list: numbers, but not `bool` and `byte`."""
    return bool(kind.array) and kind.base in TYPE_CODES and kind.base not in ("bool", "byte")


def is_converted(kind: FieldType) -> bool:
    """Whether what a decoder leaves in the field is not what programs read from it."""
    return bool(kind.array) and kind.base in TYPE_CODES


def store(field: Field) -> str:
    """The attribute in which codecs find a field; no field's own name ends with `_`, unless Python reserves it."""
    return f"_{field.name}__" if is_converted(field.type) else field.attribute


def sequence(base: str, value: Any) -> array[Any]:
    """A new `array.array` of `value`, as `array.array(typecode, value)` makes it, but numpy's arrays in one go."""
    code = TYPE_CODES[base]
    if not hasattr(value, "dtype"):
        return array(code, value)
    if value.dtype != DTYPES[base]:
        return array(code, value.ravel().tolist())
    made = array(code)
    if value.size:
        made.frombytes(np.ascontiguousarray(value).reshape(-1).view(np.uint8).data)
    return made


def fixed_array(base: str, value: Any) -> Any:
    """A new numpy array of `value`; bytes are taken for arrays of one-byte numbers."""
    if isinstance(value, (bytes, bytearray)) and DTYPES[base].itemsize == 1:
        return np.frombuffer(bytearray(value), DTYPES[base])
    return np.array(value, DTYPES[base])


def writable(value: Any) -> Any:
    """`value`, or a copy where it is a view of received bytes."""
    return value if value.flags.writeable else value.copy()


def listed(base: str, value: Any) -> Any:
    """Received booleans or octets as the list that programs know; anything else is left as it was set."""
    if not hasattr(value, "dtype"):
        return value
    items = value.tolist()
    return [_OCTETS[item] for item in items] if base == "byte" else items


def same(left: Any, right: Any) -> bool:
    """Whether two values of a field with numbers are the same ones."""
    if left.__class__ is array and right.__class__ is array:
        return bool(left == right)
    return same_values(left, right)
