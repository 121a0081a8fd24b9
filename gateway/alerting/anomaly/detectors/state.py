"""The state of many series as arrays: one array a field, one row a series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Bytes", "Field", "Floats", "Rows", "State"]

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Field:
    """One array: what a row of it looks like, and what a fresh row holds."""

    name: str
    dtype: str
    fresh: float = 0.0
    shape: tuple[int, ...] = ()


class State:
    """Arrays of a fixed number of rows, by the name of their field."""

    def __init__(self, fields: Sequence[Field], rows: int) -> None:
        self._fields = tuple(fields)
        self._arrays: dict[str, NDArray[Any]] = {
            field.name: np.zeros((rows, *field.shape), dtype=field.dtype) for field in fields
        }
        # Where a row has four lists, list k of row r is r * 4 + k here.
        self.flat = {name: array.reshape(-1) for name, array in self._arrays.items()}

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The array of a field; its first axis is the row."""
        return self._arrays[name]

    @property
    def row_bytes(self) -> int:
        """Of one row, all fields."""
        return sum(array[:1].nbytes for array in self._arrays.values())

    @property
    def size_bytes(self) -> int:
        """Of all rows."""
        return sum(array.nbytes for array in self._arrays.values())

    def reset(self, row: int) -> None:
        """Make a row as if nothing had ever been seen."""
        for field in self._fields:
            self._arrays[field.name][row] = field.fresh

    def pack(self, rows: Rows) -> Bytes:
        """The bytes of some rows, field after field: an array of so many rows and `row_bytes` columns."""
        parts = [array[rows].reshape(len(rows), -1).view(np.uint8) for array in self._arrays.values()]
        return np.concatenate(parts, axis=1)

    def unpack(self, rows: Rows, data: Bytes) -> None:
        """Set some rows from what `pack` gave."""
        start = 0
        for array in self._arrays.values():
            size = array[:1].nbytes
            part = np.ascontiguousarray(data[:, start : start + size])
            array[rows] = part.view(array.dtype).reshape(len(rows), *array.shape[1:])
            start += size
