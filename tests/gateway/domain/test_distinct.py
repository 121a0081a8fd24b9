"""The numbers of a column and their places: as numpy's own way, whatever the numbers are."""

from __future__ import annotations

import numpy as np

from gateway.domain.distinct import distinct


def test_it_agrees_with_numpy() -> None:
    columns = [[1], [0, 0], [7, 3, 7, 4095], [4096, 1], [2**32 - 1, 5, 5], list(range(70_000, 0, -1))]
    for column in columns:
        numbers, places = distinct(np.array(column, np.uint32))
        expected, inverse = np.unique(np.array(column, np.uint32), return_inverse=True)
        assert (numbers, places.tolist()) == (expected.tolist(), inverse.tolist())
