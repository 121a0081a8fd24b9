"""Numeric arrays of messages: which numpy type each primitive has, and how other Python values become one."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

from metaros.errors import FieldError
from metaros.idl.definitions import INTEGER_RANGES
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
else:
    np = LazyModule("numpy")

__all__ = ["DTYPES", "TYPE_CODES", "as_array", "as_view", "same_values"]

_NUMPY_NAMES = {
    "bool": "bool",
    "byte": "uint8",
    "char": "uint8",
    **{name: name for size in (8, 16, 32, 64) for name in (f"int{size}", f"uint{size}")},
    "float32": "float32",
    "float64": "float64",
}
TYPE_CODES: Final = dict(zip(_NUMPY_NAMES, "BBBbBhHiIqQfd", strict=True))  # of `array.array`


class _Dtypes(Mapping[str, "np.dtype[Any]"]):
    """The numpy type of each primitive; numpy is loaded when one is asked for, not to know which there are."""

    def __init__(self) -> None:
        self._made: dict[str, np.dtype[Any]] = {}

    def __getitem__(self, base: str) -> np.dtype[Any]:
        if not self._made:
            self._made = {name: np.dtype(numpy_name) for name, numpy_name in _NUMPY_NAMES.items()}
        return self._made[base]

    def __contains__(self, base: object) -> bool:
        return base in _NUMPY_NAMES

    def __iter__(self) -> Iterator[str]:
        return iter(_NUMPY_NAMES)

    def __len__(self) -> int:
        return len(_NUMPY_NAMES)


DTYPES: Final[Mapping[str, np.dtype[Any]]] = _Dtypes()


def as_array(value: Any, base: str) -> npt.NDArray[Any]:
    """`value` as a numpy array of the primitive type `base`; no copy where it already is one.

    Takes arrays, `array.array`, lists, tuples and other iterables of numbers, and for one-byte types raw bytes.
    Raises `FieldError` for what does not fit: fractions in integers, numbers out of range, text.
    """
    dtype = DTYPES[base]
    if isinstance(value, np.ndarray):
        return value if value.dtype == dtype else _cast(value, base, dtype)
    if isinstance(value, (bytes, bytearray, memoryview)):
        if dtype.itemsize == 1 and memoryview(value).itemsize == 1:
            return _cast(np.frombuffer(value, np.uint8), base, dtype) if base == "bool" else np.frombuffer(value, dtype)
        if isinstance(value, memoryview) and value.itemsize != 1:
            return as_array(np.asarray(value), base)
        raise FieldError(f"bytes are no array of {base}")
    return _from_items(value, base, dtype)


def as_view(value: Any, base: str) -> npt.NDArray[Any]:
    """The same for who only reads at once: an `array.array` of the type is looked at, not copied."""
    if type(value) is array and value.typecode == TYPE_CODES[base] and base != "bool" and len(value):
        return np.frombuffer(value, DTYPES[base])
    return as_array(value, base)


def _from_items(value: Any, base: str, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    if isinstance(value, (str, dict)):
        raise FieldError(f"expected an array of {base}, got {type(value).__name__}")
    try:
        listed = value if isinstance(value, (list, tuple, array)) else list(value)
        if base == "byte" and len(listed) and isinstance(listed[0], (bytes, bytearray)):
            listed = [ord(item) for item in listed]  # as ROS 2 programs hold them
        items = array(TYPE_CODES[base], listed)
    except (TypeError, ValueError, OverflowError) as error:
        raise FieldError(f"no array of {base}: {error}") from None
    found = np.frombuffer(items, np.uint8 if base == "bool" else dtype) if len(items) else np.empty(0, dtype)
    return _cast(found, base, dtype) if found.dtype != dtype else found


def _cast(value: npt.NDArray[Any], base: str, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    kind = value.dtype.kind
    if dtype.kind == "f" and kind in "fiub":
        with np.errstate(over="ignore"):
            return value.astype(dtype)
    if kind not in "iub" and value.size:
        raise FieldError(f"an array of {value.dtype} is no array of {base}")
    if value.size and dtype.kind != "f":
        low, high = (0, 1) if base == "bool" else INTEGER_RANGES[base]
        smallest, largest = int(value.min()), int(value.max())
        if smallest < low or largest > high:
            raise FieldError(f"{smallest if smallest < low else largest} does not fit {base} ({low} to {high})")
    return value.astype(dtype)


def same_values(left: Any, right: Any) -> bool:
    """Whether two values of an array field hold the same numbers, whatever kind of container they are in."""
    if isinstance(left, (bytes, bytearray, memoryview)):
        left = np.frombuffer(left, np.uint8)
    if isinstance(right, (bytes, bytearray, memoryview)):
        right = np.frombuffer(right, np.uint8)
    return bool(np.array_equal(left, right))
