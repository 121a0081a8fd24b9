"""Which numbers a column has, and where each stands among them: without sorting, where the numbers are low."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["distinct"]

_LEAST_TABLE, _ROW_TABLE = 4096, 8  # a table of flags may have so many entries, and so many for each row


def distinct(column: npt.NDArray[np.uint32]) -> tuple[list[int], npt.NDArray[np.unsignedinteger]]:
    """The numbers of a column, ascending, and for each row the place of its number; not of an empty column.

    The places are of two bytes where that is enough: numpy sorts those by counting.
    """
    top = int(column.max()) + 1
    if top > _LEAST_TABLE + _ROW_TABLE * len(column):
        numbers, places = np.unique(column, return_inverse=True)
        return numbers.tolist(), places.astype(_dtype(len(numbers)))
    there = np.zeros(top, np.bool_)
    there[column] = True
    found = np.flatnonzero(there)
    table = np.empty(top, _dtype(len(found)))
    table[found] = np.arange(len(found))
    return found.tolist(), table[column]


def _dtype(count: int) -> type[np.unsignedinteger]:
    return np.uint16 if count <= 1 << 16 else np.uint32
