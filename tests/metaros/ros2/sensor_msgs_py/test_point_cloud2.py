"""Point clouds there and back."""

from __future__ import annotations

import array
from typing import Any

import numpy as np
import pytest

from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.sensor_msgs_py import numpy_compat, point_cloud2

ROWS = [(0.0, 0.5, 1.0), (2.0, np.nan, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0)]
XYZ = np.array(ROWS, np.float32)
FLOAT32, FLOAT64, UINT8 = 7, 8, 2


def field(name: str, offset: int, datatype: int = FLOAT32, count: int = 1) -> Any:
    return interface("sensor_msgs/msg/PointField")(name=name, offset=offset, datatype=datatype, count=count)


def header() -> Any:
    return interface("std_msgs/msg/Header")(frame_id="map")


@pytest.fixture(params=["array.array", "bytes", "numpy", "list"])
def xyz(request: pytest.FixtureRequest) -> Any:
    cloud = point_cloud2.create_cloud_xyz32(header(), XYZ)
    data = bytes(cloud.data)
    makers: dict[str, Any] = {
        "array.array": lambda: array.array("B", data),
        "bytes": lambda: data,
        "numpy": lambda: np.frombuffer(data, np.uint8),
        "list": lambda: list(data),
    }
    try:
        cloud.data = makers[request.param]()
    except Exception:  # a message class that takes only some of them has been asked enough
        pytest.skip("the message class does not take it")
    return cloud


def test_what_is_made_is_read(xyz: Any) -> None:
    assert (xyz.height, xyz.width, xyz.point_step, xyz.row_step, xyz.is_dense) == (1, 4, 12, 48, False)
    points = point_cloud2.read_points(xyz)
    assert points.dtype.names == ("x", "y", "z")
    np.testing.assert_array_equal(points["z"], XYZ[:, 2])
    np.testing.assert_array_equal(point_cloud2.read_points_numpy(xyz), XYZ)
    np.testing.assert_array_equal(point_cloud2.read_points_numpy(xyz, field_names=("x", "z")), XYZ[:, [0, 2]])
    np.testing.assert_array_equal(point_cloud2.read_points_numpy(xyz, skip_nans=True), XYZ[[0, 2, 3]])
    assert len(point_cloud2.read_points(xyz, ["x"], skip_nans=True)) == 4, "what is not read may be NaN"
    np.testing.assert_array_equal(point_cloud2.read_points_numpy(xyz, uvs=iter([3, 0])), XYZ[[3, 0]])
    named = point_cloud2.read_points_list(xyz, skip_nans=True)
    assert (named[1].x, named[1]._fields) == (4.0, ("x", "y", "z"))
    xyz.is_dense = True
    assert len(point_cloud2.read_points(xyz, skip_nans=True)) == 4, "a dense cloud has none, it says"


def test_rows_of_numbers_and_plain_arrays_make_the_same_cloud() -> None:
    fields = [field("x", 0), field("y", 4), field("z", 8)]
    clouds = [
        point_cloud2.create_cloud_xyz32(header(), ROWS),
        point_cloud2.create_cloud_xyz32(header(), np.array(ROWS)),
        point_cloud2.create_cloud(header(), iter(fields), ROWS),
        point_cloud2.create_cloud(header(), fields, np.array(ROWS, [("x", "f4"), ("y", "f4"), ("z", "f4")])),
    ]
    assert [cloud == clouds[0] for cloud in clouds] == [True] * 4
    assert len(point_cloud2.create_cloud_xyz32(header(), np.empty((0, 3))).data) == 0
    assert point_cloud2.read_points(point_cloud2.create_cloud_xyz32(header(), [])).shape == (0,)


def test_fields_of_several_types_values_and_paddings() -> None:
    dtype = np.dtype({"names": ["a", "b"], "formats": ["<f8", "u1"], "offsets": [0, 12], "itemsize": 20})
    points = np.zeros(3, dtype)
    points["a"], points["b"] = [1.5, 2.5, 3.5], [7, 8, 9]
    fields = [field("a", 0, FLOAT64), field("b", 12, UINT8)]
    cloud = point_cloud2.create_cloud(header(), fields, points)
    assert cloud.point_step == 20
    assert point_cloud2.read_points(cloud).dtype == dtype
    np.testing.assert_array_equal(point_cloud2.read_points(cloud), points)
    np.testing.assert_array_equal(point_cloud2.read_points_numpy(cloud, ["b"]), [[7], [8], [9]])
    several = [field("", 0, count=2), field("n", 8, count=1)]
    assert point_cloud2.dtype_from_fields(several).names == ("unnamed_field_0_0", "unnamed_field_0_1", "n")
    made = point_cloud2.create_cloud(header(), several, XYZ)
    np.testing.assert_array_equal(point_cloud2.read_points_numpy(made), XYZ)
    assert point_cloud2.read_points_list(made)[3].n == 9.0


def test_organized_clouds() -> None:
    grid = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    cloud = point_cloud2.create_cloud_xyz32(header(), grid)
    assert (cloud.width, cloud.height) == (2, 4)
    shaped = point_cloud2.read_points(cloud, reshape_organized_cloud=True)
    np.testing.assert_array_equal(numpy_compat.structured_to_unstructured(shaped), grid)
    assert point_cloud2.read_points(cloud).shape == (8,)


def test_rows_that_are_padded() -> None:
    cloud = point_cloud2.create_cloud_xyz32(header(), XYZ)
    raw = bytes(cloud.data)
    cloud.height, cloud.width, cloud.row_step = 2, 2, 30
    cloud.data = array.array("B", raw[:24] + b"______" + raw[24:] + b"______")
    np.testing.assert_array_equal(point_cloud2.read_points_numpy(cloud), XYZ)


def test_the_other_byte_order_is_read_as_often_as_one_likes() -> None:
    cloud = point_cloud2.create_cloud_xyz32(header(), XYZ)
    cloud.data = array.array("B", XYZ.astype(">f4").tobytes())
    cloud.is_bigendian = True
    for _ in range(2):
        np.testing.assert_array_equal(point_cloud2.read_points_numpy(cloud), XYZ)


def test_what_does_not_fit_is_an_assertion_error() -> None:
    xyz = point_cloud2.create_cloud_xyz32(header(), XYZ)
    mixed = point_cloud2.create_cloud(header(), [field("a", 0), field("b", 4, FLOAT64)], [(1.0, 2.0)])
    padded = np.zeros(2, np.dtype({"names": ["x"], "formats": ["f4"], "offsets": [0], "itemsize": 8}))
    short = point_cloud2.create_cloud_xyz32(header(), XYZ)
    short.width = 5
    cases: dict[str, Any] = {
        "is no sensor_msgs": lambda: point_cloud2.read_points(header()),
        "asked was": lambda: point_cloud2.read_points(xyz, ["w"]),
        "several types: read_points": lambda: point_cloud2.read_points_numpy(mixed),
        "fields of several types": lambda: point_cloud2.create_cloud(header(), mixed.fields, XYZ[:, :2]),
        "does not match": lambda: point_cloud2.create_cloud(header(), [field("x", 0)], padded, 4),
        "are called": lambda: point_cloud2.dtype_from_fields([field("x", 0), field("x", 4)]),
        "count of 0": lambda: point_cloud2.dtype_from_fields([field("x", 0, count=0)]),
        "more than 4096 values": lambda: point_cloud2.dtype_from_fields([field("x", 0, count=2**32 - 1)]),
        "unknown type": lambda: point_cloud2.dtype_from_fields([field("x", 0, datatype=9)]),
        "too few": lambda: point_cloud2.read_points(short),
        "columns": lambda: point_cloud2.create_cloud_xyz32(header(), XYZ[:, :2]),
        "dimension": lambda: point_cloud2.create_cloud_xyz32(header(), np.zeros((2, 2, 2, 3))),
    }
    wrong = {}
    for text, act in cases.items():
        try:
            act()
        except AssertionError as error:
            if text not in str(error):
                wrong[text] = str(error)
        else:
            wrong[text] = "nothing was raised"
    assert wrong == {}
