"""Point clouds: structured arrays and columns, colours, both byte orders, views instead of copies."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.cdr import codec
from metaros.convert import numpy_to_points, points_rgb, points_to_numpy, points_xyz
from metaros.errors import DecodeError, FieldError
from metaros.interfaces.sensor_msgs.msg import PointCloud2, PointField
from tests.support.tables import cases

LIDAR = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": ["f4", "f4", "f4", "f4", "u2", "f8"],
        "offsets": [0, 4, 8, 16, 20, 24],
        "itemsize": 32,
    }
)


def lidar(count: int = 5) -> Any:
    points = np.zeros(count, LIDAR)
    for index, name in enumerate(LIDAR.names or ()):
        points[name] = np.arange(count) * (index + 1) + 0.5 * (LIDAR[name].kind == "f")
    return points


def turned(cloud: Any) -> Any:
    """The same cloud in the other byte order."""
    points = points_to_numpy(cloud)
    cloud.data = points.byteswap().reshape(-1).view(np.uint8)
    cloud.is_bigendian = sys.byteorder != "big"
    return cloud


def test_a_structured_cloud_with_gaps_crosses_uncopied() -> None:
    points = lidar()
    cloud = numpy_to_points(points, stamp_ns=3, frame_id="lidar")
    assert np.shares_memory(cloud.data, points)
    assert (cloud.height, cloud.width, cloud.point_step, cloud.row_step, cloud.is_dense) == (1, 5, 32, 160, True)
    assert [(field.name, field.offset, field.datatype, field.count) for field in cloud.fields] == [
        ("x", 0, 7, 1),
        ("y", 4, 7, 1),
        ("z", 8, 7, 1),
        ("intensity", 16, 7, 1),
        ("ring", 20, 4, 1),
        ("time", 24, 8, 1),
    ]
    received = codec(PointCloud2).decode(codec(PointCloud2).encode(cloud))
    back = points_to_numpy(received)
    assert back.dtype == LIDAR
    assert all((back[name] == points[name]).all() for name in LIDAR.names or ())
    xyz = points_xyz(received)
    assert np.shares_memory(xyz, received.data)
    assert xyz.tolist() == np.stack([points["x"], points["y"], points["z"]], axis=-1).tolist()


@cases(
    ("columns", "fields", "names"),
    [(3, (), "x y z"), (4, (), "x y z intensity"), (5, ("x", "y", "z", "ring", "t"), "x y z ring t")],
)
def test_columns_are_named_and_not_copied(columns: int, fields: tuple[str, ...], names: str) -> None:
    points = np.arange(7 * columns, dtype=np.float32).reshape(7, columns)
    cloud = numpy_to_points(points, fields=fields)
    assert np.shares_memory(cloud.data, points)
    assert [field.name for field in cloud.fields] == names.split()
    assert (points_xyz(cloud) == points[:, :3]).all()
    assert points_to_numpy(cloud)[names.split()[-1]].tolist() == points[:, -1].tolist()


def test_the_other_byte_order_is_turned() -> None:
    cloud = turned(numpy_to_points(lidar()))
    back = points_to_numpy(cloud)
    assert all((back[name] == lidar()[name]).all() for name in LIDAR.names or ())
    assert back["x"].dtype.isnative
    assert (points_xyz(cloud)[:, 1] == lidar()["y"]).all()


def test_points_that_are_no_numbers_are_left_out_on_request() -> None:
    points = np.array([[1, 2, 3], [np.nan, 0, 0], [4, 5, np.inf], [7, 8, 9]], np.float32)
    cloud = numpy_to_points(points)
    assert not cloud.is_dense
    assert points_xyz(cloud).shape == (4, 3)
    assert points_xyz(cloud, skip_nan=True).tolist() == [[1, 2, 3], [7, 8, 9]]


def test_an_image_of_points_keeps_its_rows_even_padded_ones() -> None:
    points = np.arange(2 * 3 * 3, dtype=np.float32).reshape(2, 3, 3)
    cloud = numpy_to_points(points)
    assert (cloud.height, cloud.width, cloud.row_step) == (2, 3, 36)
    assert (points_xyz(cloud) == points).all()
    cloud.data = np.pad(cloud.data.reshape(2, 36), ((0, 0), (0, 12))).reshape(-1)
    cloud.row_step = 48
    assert (points_xyz(cloud) == points).all()
    assert points_xyz(cloud, skip_nan=True).shape == (6, 3)


@cases("big", [False, True])
def test_colours_are_packed_as_viewers_expect_them(big: bool) -> None:
    points = np.ones((3, 3), np.float32)
    rgb = np.array([[255, 0, 1], [0, 128, 2], [9, 8, 7]], np.uint8)
    cloud = numpy_to_points(points, rgb=rgb)
    assert (cloud.fields[3].name, cloud.fields[3].datatype, cloud.point_step) == ("rgb", PointField.FLOAT32, 16)
    assert cloud.data[12:16].tolist() == [1, 0, 255, 0]
    cloud = turned(cloud) if big else cloud
    assert (points_rgb(cloud) == rgb).all()
    assert (points_xyz(cloud) == points).all()


def test_coordinates_apart_and_of_several_types_are_gathered() -> None:
    points = np.zeros(2, [("z", "f8"), ("x", "i4"), ("y", "f4")])
    points["x"], points["y"], points["z"] = [1, 2], [3, 4], [5, 6]
    assert points_xyz(numpy_to_points(points)).tolist() == [[1, 3, 5], [2, 4, 6]]


def test_fields_of_several_numbers_and_empty_clouds() -> None:
    points = np.zeros(2, [("x", "f4"), ("normal", "f4", (3,))])
    points["normal"] = [[1, 2, 3], [4, 5, 6]]
    cloud = numpy_to_points(points)
    assert [(field.name, field.count) for field in cloud.fields] == [("x", 1), ("normal", 3)]
    assert (points_to_numpy(cloud)["normal"] == points["normal"]).all()
    empty = numpy_to_points(np.empty((0, 3), np.float32))
    assert (empty.width, points_xyz(empty).shape, points_xyz(turned(empty)).shape) == (0, (0, 3), (0, 3))


@cases(
    ("points", "options", "message"),
    [
        (np.zeros((2, 5), "f4"), {}, "5 columns need as many names"),
        (np.zeros((2, 3), "f4"), {"fields": ("x", "x", "y")}, "3 columns need as many names"),
        (np.zeros(3, "f4"), {}, "not of 1 dimensions"),
        (np.zeros((2, 3), "i8"), {}, "a cloud cannot hold int64; use float32"),
        (np.zeros(2, [("x", "f4"), ("t", "i8")]), {}, "t: a cloud cannot hold int64"),
        (np.zeros((2, 3), "f4"), {"rgb": np.zeros((3, 3), "u1")}, "rgb: uint8 of shape"),
    ],
)
def test_what_is_no_cloud_is_refused(points: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(FieldError, match=message):
        numpy_to_points(points, **options)


@cases(
    ("change", "message"),
    [
        ({"point_step": 8}, "ends behind the 8 bytes of a point"),
        ({"point_step": 0}, "fields in points of 0 bytes"),
        ({"width": 6}, "160 bytes are too few for 1 x 6 points"),
        ({"height": 2, "width": 5, "row_step": 10}, "rows of 10 bytes are too short"),
        ({"fields": []}, "0 fields in points"),
        ({"fields": [PointField(name="x", datatype=9)]}, "has no sound type or name"),
        ({"fields": [PointField(name="x", datatype=7)] * 2}, "has no sound type or name"),
        ({"fields": [PointField(name="x", datatype=7)]}, "the cloud has no x, y, z; its fields are x"),
    ],
)
def test_a_cloud_that_contradicts_itself_is_a_decode_error(change: dict[str, Any], message: str) -> None:
    cloud = numpy_to_points(lidar())
    for name, value in change.items():
        setattr(cloud, name, value)
    with pytest.raises(DecodeError, match=message):
        points_xyz(cloud)


def test_a_cloud_without_colours_says_so() -> None:
    with pytest.raises(DecodeError, match="no packed colours; its fields are x, y, z, intensity, ring, time"):
        points_rgb(numpy_to_points(lidar()))


NUMBER = st.integers(0, 2**32 - 1) | st.integers(0, 64)


@settings(max_examples=80, deadline=None)
@given(
    NUMBER,
    NUMBER,
    NUMBER,
    NUMBER,
    st.booleans(),
    st.binary(max_size=300),
    st.lists(
        st.builds(
            PointField,
            name=st.sampled_from(["x", "y", "z", ""]),
            offset=NUMBER,
            datatype=st.integers(0, 10),
            count=NUMBER,
        ),
        max_size=4,
    ),
)
def test_any_cloud_is_points_or_a_decode_error(height, width, step, row, big, data, fields):
    cloud = PointCloud2(height=height, width=width, fields=fields, is_bigendian=big, point_step=step, row_step=row)
    cloud.data = np.frombuffer(data, np.uint8)
    try:
        points_xyz(cloud, skip_nan=True)
    except DecodeError:
        return
