"""QuantizedCloud: half a step of error, wider steps for wide clouds, and nothing that is no number."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from metaros.convert import (
    numpy_to_points,
    numpy_to_quantized,
    points_to_quantized,
    points_xyz,
    quantized_to_numpy,
    quantized_to_points,
)
from metaros.errors import DecodeError, FieldError
from metaros.interfaces.metaros_msgs.msg import QuantizedCloud
from tests.support.tables import cases

POINTS = np.array([[-1.5, 2.0, 0.25, 7.4], [3.21, -4.0, 9.0, 300.0], [0.0, 0.0, 0.0, -2.0]], np.float32)


def test_there_and_back_within_half_a_step() -> None:
    made = numpy_to_quantized(POINTS, step_m=0.01, stamp_ns=5_000_000_001, frame_id="velodyne")
    assert (made.count, made.has_intensity, len(made.data)) == (3, True, 21)
    assert (made.header.stamp.sec, made.header.stamp.nanosec, made.header.frame_id) == (5, 1, "velodyne")
    again = quantized_to_numpy(made)
    for axis, name in enumerate("xyz"):
        assert np.abs(again[name] - POINTS[:, axis]).max() <= 0.00501
    assert again["intensity"].tolist() == [7.0, 255.0, 0.0]


def test_its_bytes_are_as_documented() -> None:
    made = numpy_to_quantized(np.array([[1, 2, 3, 9], [2, 2, 3.5, 8]], np.float32), step_m=0.5)
    assert list(made.origin) == [1.0, 2.0, 3.0]
    assert bytes(made.data) == bytes([0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 1, 0, 9, 8])


def test_a_cloud_wider_than_the_grid_gets_a_wider_step() -> None:
    wide = np.array([[0, 0, 0], [10_000.0, 1, 1]], np.float32)
    made = numpy_to_quantized(wide, step_m=0.01)
    assert made.step_m == pytest.approx(10_000 / 65_535, rel=1e-6)
    assert quantized_to_numpy(made)["x"].tolist() == pytest.approx([0, 10_000], abs=0.1)


def test_what_is_no_number_is_left_out() -> None:
    bad = np.array([[np.nan, 0, 0], [1, np.inf, 0], [1, 2, 3]], np.float32)
    assert quantized_to_numpy(numpy_to_quantized(bad)).tolist() == [(1.0, 2.0, 3.0)]


def test_empty_clouds() -> None:
    made = numpy_to_quantized(np.empty((0, 3), np.float32))
    assert (made.count, len(made.data), made.has_intensity) == (0, 0, False)
    assert len(quantized_to_numpy(made)) == 0


def test_from_and_to_a_point_cloud() -> None:
    cloud = numpy_to_points(POINTS, stamp_ns=7, frame_id="lidar")
    small = points_to_quantized(cloud, step_m=0.001)
    again = quantized_to_points(small)
    assert again.header == cloud.header
    assert np.abs(points_xyz(again) - POINTS[:, :3]).max() <= 0.000501
    assert [field.name for field in again.fields] == ["x", "y", "z", "intensity"]


@cases(
    "absurd",
    [
        QuantizedCloud(count=2**32 - 1, step_m=0.01, data=bytes(70)),
        QuantizedCloud(count=1, step_m=0.01, has_intensity=True, data=bytes(6)),
        QuantizedCloud(count=1, step_m=0.0, data=bytes(6)),
        QuantizedCloud(count=1, step_m=float("nan"), data=bytes(6)),
        QuantizedCloud(count=1, step_m=0.1, origin=np.array([0.0, np.inf, 0.0]), data=bytes(6)),
    ],
)
def test_what_contradicts_itself_is_refused(absurd: QuantizedCloud) -> None:
    with pytest.raises(DecodeError):
        quantized_to_numpy(absurd)


@cases("step_m", [0.0, -1.0, float("nan"), float("inf")])
def test_a_step_that_is_none_is_refused(step_m: float) -> None:
    with pytest.raises(FieldError):
        numpy_to_quantized(POINTS, step_m=step_m)


def test_without_coordinates_there_is_no_cloud() -> None:
    with pytest.raises(FieldError, match="x, y and z"):
        numpy_to_quantized(np.zeros(3, np.dtype([("x", "f4"), ("y", "f4")])))


@settings(max_examples=50, deadline=None)
@given(arrays(np.float32, st.tuples(st.integers(0, 40), st.just(4)), elements=st.floats(width=32)))
def test_any_numbers_are_within_a_step(points: np.ndarray) -> None:
    made = numpy_to_quantized(points, step_m=0.01)
    finite = points[np.isfinite(points[:, :3]).all(axis=1)].astype(np.float64)
    again = quantized_to_numpy(made)
    assert made.count == len(finite)
    for axis, name in enumerate("xyz"):
        assert (np.abs(again[name] - finite[:, axis]) <= made.step_m * 0.51 + np.abs(finite[:, axis]) * 1e-6).all()
