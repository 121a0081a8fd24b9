"""Values that become numpy arrays."""

from __future__ import annotations

from array import array

import numpy as np
import pytest

from metaros.errors import FieldError
from metaros.idl.arrays import DTYPES, as_array, same_values
from tests.support.tables import cases


@cases("base", DTYPES)
def test_lists_of_every_type(base: str) -> None:
    values = as_array([1, 0, 1], base)
    assert values.dtype == DTYPES[base]
    assert values.tolist() == [1, 0, 1]
    assert as_array([], base).dtype == DTYPES[base]
    assert as_array(values, base) is values


def test_other_containers() -> None:
    assert as_array((1, 2), "int16").tolist() == [1, 2]
    assert as_array(range(3), "float32").tolist() == [0.0, 1.0, 2.0]
    assert as_array(array("d", [1.5]), "float64").tolist() == [1.5]
    assert as_array(b"ab", "byte").tolist() == [97, 98]
    assert as_array(memoryview(b"\0\1"), "bool").tolist() == [False, True]
    assert as_array(memoryview(array("I", [7])), "uint32").tolist() == [7]


def test_casts_keep_values() -> None:
    assert as_array(np.array([1, 2], dtype=np.int64), "uint8").tolist() == [1, 2]
    assert as_array(np.array([0.5]), "float32").dtype == np.float32
    assert as_array(np.array([1, 2], dtype=">u4"), "uint32").tolist() == [1, 2]
    assert as_array(np.array([]), "int32").dtype == np.int32


@cases(
    ("value", "base"),
    [
        ([2], "bool"),
        ([-1], "uint64"),
        ([2**63], "int64"),
        ([0.5], "int32"),
        (np.array([0.5]), "int32"),
        (np.array([300]), "int8"),
        (np.array(["a"]), "uint8"),
        (np.array([1j]), "float32"),
        (b"abcd", "float32"),
        ("abc", "uint8"),
        (5, "uint8"),
        ([[1]], "uint8"),
    ],
)
def test_what_does_not_fit(value: object, base: str) -> None:
    with pytest.raises(FieldError):
        as_array(value, base)


def test_same_values() -> None:
    assert same_values(np.array([1, 2]), [1, 2])
    assert same_values(b"\1", np.array([1], dtype=np.uint8))
    assert not same_values([1], [1, 2])
