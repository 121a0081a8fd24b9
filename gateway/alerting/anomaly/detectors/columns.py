"""Arrays of one length, a row a slot: the state of detectors over many series, grown by pages and kept as bytes."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["Bools", "Columns", "Floats", "Ints", "Parts", "pack", "unpack"]

PAGE_ROWS, PAGE_BYTES = 512, 2**18  # a page has no more of either, but one row at least
Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Parts = Mapping[str, Mapping[str, npt.NDArray[Any]]]


class Columns:
    """Named arrays whose first axis is the slot. `columns[name]` is the live array until the next `grow` or `load`."""

    def __init__(self, **fills: npt.NDArray[Any] | np.generic) -> None:
        """A fill's type and shape are those of one row: `np.float64(0)`, or `np.zeros((4, 2))`."""
        self._fills: dict[str, npt.NDArray[Any]] = {name: np.asarray(fill) for name, fill in fills.items()}
        self._arrays = {name: np.empty((0, *fill.shape), fill.dtype) for name, fill in self._fills.items()}

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        return self._arrays[name]

    def __len__(self) -> int:
        return len(next(iter(self._arrays.values())))

    @property
    def size_bytes(self) -> int:
        """What the arrays take."""
        return sum(array.nbytes for array in self._arrays.values())

    def grow(self, rows: int) -> None:
        """Have at least `rows` rows, a whole number of pages."""
        page = max(1, min(PAGE_ROWS, PAGE_BYTES // sum(fill.nbytes for fill in self._fills.values())))
        missing = -(-rows // page) * page - len(self)
        if missing <= 0:
            return
        for name, fill in self._fills.items():
            fresh = np.broadcast_to(fill, (missing, *fill.shape))
            self._arrays[name] = np.concatenate((self._arrays[name], fresh))

    def reset(self, rows: Ints | int) -> None:
        """These rows as they were at first."""
        for name, fill in self._fills.items():
            self._arrays[name][rows] = fill

    def take(self, rows: Ints) -> dict[str, npt.NDArray[Any]]:
        """Copies of some rows, by name."""
        return {name: array[rows] for name, array in self._arrays.items()}

    def put(self, rows: Ints, arrays: Mapping[str, npt.NDArray[Any]], *, keep: Sequence[str] = ()) -> None:
        """Set some rows to what `take` gave, but for the arrays to `keep`. Raises ValueError as `load` does."""
        self._check(arrays, len(rows))
        for name, array in arrays.items():
            if name not in keep:
                self._arrays[name][rows] = array

    def dump(self) -> dict[str, npt.NDArray[Any]]:
        """The arrays by name."""
        return dict(self._arrays)

    def load(self, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take over what `dump` gave. Raises ValueError for other names, types or shapes."""
        self._check(arrays, max((len(array) for array in arrays.values()), default=0))
        self._arrays = {name: np.array(array) for name, array in arrays.items()}

    def _check(self, arrays: Mapping[str, npt.NDArray[Any]], rows: int) -> None:
        if arrays.keys() != self._fills.keys():
            raise ValueError(f"columns {sorted(arrays)} where {sorted(self._fills)} belong")
        for name, fill in self._fills.items():
            if arrays[name].dtype != fill.dtype or arrays[name].shape != (rows, *fill.shape):
                raise ValueError(f"column {name} is {arrays[name].dtype}{arrays[name].shape}")


def pack(parts: Parts) -> bytes:
    """Groups of named arrays as the bytes of one npz file."""
    file = io.BytesIO()
    flat: dict[str, Any] = {}
    for group, arrays in parts.items():
        flat.update({f"{group}/{name}": array for name, array in arrays.items()})
    np.savez(file, **flat)
    return file.getvalue()


def unpack(data: bytes) -> dict[str, dict[str, npt.NDArray[Any]]]:
    """What `pack` was given. Raises ValueError where the bytes are none of its."""
    groups: dict[str, dict[str, npt.NDArray[Any]]] = {}
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            for path in file.files:
                group, _, name = path.partition("/")
                groups.setdefault(group, {})[name] = file[path]
    except (OSError, EOFError, KeyError, NotImplementedError, RuntimeError, ValueError, zipfile.BadZipFile) as error:
        raise ValueError(f"no arrays in these bytes: {error}") from error
    return groups
