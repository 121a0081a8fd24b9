"""What fields of `@message` classes hold: bytes, lists, tuples, enums and shaped arrays rather than flat numpy ones.

A holder is called with whatever is assigned: by the user, or by the decoder with flat arrays and plain numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from math import prod
from typing import TYPE_CHECKING, Any

from metaros.errors import FieldError
from metaros.idl.arrays import DTYPES, as_array
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")

__all__ = ["enum_holder", "hold_bytes", "hold_tuple", "list_holder", "shape_holder"]


def hold_bytes(value: Any) -> bytes:
    """Bytes, of anything that is a buffer of them or lists them."""
    if type(value) is bytes:
        return value
    if isinstance(value, (bytearray, memoryview)):
        return bytes(value)
    return as_array(value, "uint8").tobytes()


def hold_tuple(value: Any) -> tuple[Any, ...]:
    """A tuple of numbers."""
    return tuple(_listed(value))


def list_holder(enum: type[Enum] | None) -> Callable[[Any], list[Any]]:
    """A list of numbers: the very list that is assigned, so that one may append to it."""
    if enum is None:
        return _listed
    one = enum_holder(enum)
    return lambda value: [one(item) for item in _listed(value)]


def enum_holder(enum: type[Enum]) -> Callable[[Any], Any]:
    """The member of that value; a value that is none of ours, from a newer peer, stays what it is."""

    def hold(value: Any) -> Any:
        if value.__class__ is enum:
            return value
        try:
            return enum(value)
        except ValueError:
            return value

    return hold


def shape_holder(base: str, dims: tuple[int | None, ...]) -> Callable[[Any], Any]:
    """An array of that element type and shape; flat ones of the right size are given the shape."""
    shape = tuple(-1 if size is None else size for size in dims)
    row = prod(size for size in dims[1:] if size)
    count = -1 if dims[0] is None else row * dims[0]

    dtype: Any = None

    def hold(value: Any) -> Any:
        nonlocal dtype
        if dtype is None:
            dtype = DTYPES[base]
        if value.__class__ is np.ndarray and value.dtype is dtype and value.ndim == 1 and value.size == count:
            return value.reshape(shape)  # what the decoder brings
        array = _numbers(value, base)
        good = array.size == count if count >= 0 else array.size % row == 0
        if not good or (array.ndim > 1 and array.shape[1:] != shape[1:]):
            wanted = tuple("any" if size is None else size for size in dims)
            raise FieldError(f"an array of shape {array.shape} is not of shape ({', '.join(map(str, wanted))})")
        return array.reshape(shape)

    return hold


def _numbers(value: Any, base: str) -> Any:
    dtype = DTYPES[base]
    if type(value) is np.ndarray:
        return value if value.dtype is dtype else as_array(value, base)
    if isinstance(value, (list, tuple)) and value and isinstance(value[0], (list, tuple, np.ndarray)):
        try:
            return as_array(np.asarray(value), base)
        except ValueError:
            raise FieldError("the rows are of different lengths") from None
    return as_array(value, base)


def _listed(value: Any) -> list[Any]:
    if type(value) is list:
        return value
    if isinstance(value, (str, dict)):
        raise FieldError(f"expected a list of numbers, got {type(value).__name__}")
    return value.tolist() if hasattr(value, "tolist") else list(value)
