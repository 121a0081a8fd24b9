"""Between numpy and `sensor_msgs.msg.PointCloud2`, as sensor_msgs_py does it.

Structured arrays have a field a point field, by its name; a field of several values becomes `name_0`, `name_1` …, and
one without a name `unnamed_field_0`, by its place. What does not fit together is an AssertionError, as there.
"""

from __future__ import annotations

import array
import sys
from collections import namedtuple
from collections.abc import Iterable
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numpy.lib.recfunctions import structured_to_unstructured, unstructured_to_structured

from metaros.idl.arrays import as_view
from metaros.ros2.rosidl.catalogue import interface

__all__ = [
    "DUMMY_FIELD_PREFIX",
    "create_cloud",
    "create_cloud_xyz32",
    "dtype_from_fields",
    "read_points",
    "read_points_list",
    "read_points_numpy",
]

DUMMY_FIELD_PREFIX: Final = "unnamed_field"

_MOST_VALUES: Final = 4096  # of one point: a message of a few bytes may claim four thousand million

_FLOAT32: Final = 7
_DTYPES: Final = {
    number: np.dtype(name)
    for number, name in enumerate(("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"), 1)
}
_BIG: Final = sys.byteorder == "big"


def read_points(
    cloud: Any,
    field_names: Iterable[str] | None = None,
    skip_nans: bool = False,
    uvs: Iterable[int] | None = None,
    reshape_organized_cloud: bool = False,
) -> npt.NDArray[Any]:
    """The points as a structured array: a view of the message's bytes where nothing has to be left out or swapped.

    `field_names` leaves out other fields; `skip_nans` points with a NaN in what is left, if the cloud may have any;
    `uvs` takes the points of these indices alone; an organized cloud is (width, height) if that is asked, else flat.
    """
    _check(hasattr(cloud, "point_step"), f"a {type(cloud).__name__} is no sensor_msgs.msg.PointCloud2")
    points = _points(cloud)
    if field_names is not None:
        names = list(field_names)
        known = points.dtype.names or ()
        _check(
            all(name in known for name in names), f"the fields of the cloud are {', '.join(known)}: asked was {names}"
        )
        points = points[names]
    if bool(cloud.is_bigendian) != _BIG:
        points = points.byteswap()
    if skip_nans and not cloud.is_dense:
        whole = np.ones(len(points), dtype=bool)
        for name in points.dtype.names or ():
            whole &= ~np.isnan(points[name])
        points = points[whole]
    if uvs is not None:
        points = points[uvs if isinstance(uvs, np.ndarray) else np.fromiter(uvs, int)]
    if reshape_organized_cloud and cloud.height > 1:
        points = points.reshape(cloud.width, cloud.height)
    return points


def read_points_numpy(
    cloud: Any,
    field_names: Iterable[str] | None = None,
    skip_nans: bool = False,
    uvs: Iterable[int] | None = None,
    reshape_organized_cloud: bool = False,
) -> npt.NDArray[Any]:
    """The points as a plain array, a column a field: for fields that are all of one type."""
    names = None if field_names is None else list(field_names)
    types = {field.datatype for field in cloud.fields if names is None or field.name in names}
    _check(len(types) < 2, "the fields are of several types: read_points() gives them as a structured array")
    plain: npt.NDArray[Any] = structured_to_unstructured(
        read_points(cloud, names, skip_nans, uvs, reshape_organized_cloud)
    )
    return plain


def read_points_list(
    cloud: Any,
    field_names: Iterable[str] | None = None,
    skip_nans: bool = False,
    uvs: Iterable[int] | None = None,
) -> list[Any]:
    """The points as named tuples: slow, and for small clouds."""
    points = read_points(cloud, field_names, skip_nans, uvs)
    point = namedtuple("Point", points.dtype.names or ())  # type: ignore[misc]
    return [point._make(values) for values in points]


def dtype_from_fields(fields: Iterable[Any], point_step: int | None = None) -> np.dtype[Any]:
    """The numpy type of one point. `point_step` is how many bytes it takes, where that is more than its fields do."""
    names: list[str] = []
    formats: list[str] = []
    offsets: list[int] = []
    for index, field in enumerate(fields):
        _check(field.datatype in _DTYPES, f"field {field.name!r} has the unknown type {field.datatype}")
        _check(field.count > 0, f"field {field.name!r} has a count of 0")
        _check(len(names) + field.count <= _MOST_VALUES, f"a point has more than {_MOST_VALUES} values")
        dtype, name = _DTYPES[field.datatype], field.name or f"{DUMMY_FIELD_PREFIX}_{index}"
        for part in range(field.count):
            own = f"{name}_{part}" if field.count > 1 else name
            _check(own not in names, f"two fields are called {own!r}")
            names.append(own)
            formats.append(dtype.str)
            offsets.append(field.offset + part * dtype.itemsize)
    layout: dict[str, Any] = {"names": names, "formats": formats, "offsets": offsets}
    if point_step is not None:
        layout["itemsize"] = point_step
    return np.dtype(layout)  # type: ignore[call-overload, no-any-return]  # a layout of sizes that are known at run time


def create_cloud(header: Any, fields: Iterable[Any], points: Any, point_step: int | None = None) -> Any:
    """A PointCloud2 of points: a plain array with a column a field, a structured array, or rows of Python numbers.

    An array of two dimensions (structured) or three (plain) makes an organized cloud, (width, height).
    """
    fields = list(fields)
    if not isinstance(points, np.ndarray):
        rows = [tuple(row) for row in points]
        made: npt.NDArray[Any] = np.array(rows, dtype=dtype_from_fields(fields, point_step))
    elif points.dtype.names is None:
        types = {field.datatype for field in fields}
        _check(len(types) < 2, "fields of several types need a structured array: one column has one type")
        made = _structured(points, dtype_from_fields(fields, point_step))
    else:
        wanted = dtype_from_fields(fields, points.dtype.itemsize if point_step is None else point_step)
        _check(points.dtype == wanted, f"an array of {points.dtype} does not match the fields, which are {wanted}")
        made = points
    _check(made.ndim in (1, 2), f"a cloud has one dimension or two, not {made.ndim}")
    data = array.array("B")
    data.frombytes(made.tobytes())
    width, height = made.shape[0], made.shape[1] if made.ndim == 2 else 1
    cloud = interface("sensor_msgs/msg/PointCloud2")(
        header=header,
        height=height,
        width=width,
        is_dense=False,
        is_bigendian=_BIG,
        fields=fields,
        point_step=made.dtype.itemsize,
        row_step=made.dtype.itemsize * width,
    )
    cloud.data = data
    return cloud


def create_cloud_xyz32(header: Any, points: Any) -> Any:
    """A PointCloud2 of x, y, z as float32."""
    field = interface("sensor_msgs/msg/PointField")
    return create_cloud(
        header, [field(name=name, offset=4 * i, datatype=_FLOAT32, count=1) for i, name in enumerate("xyz")], points
    )


def _points(cloud: Any) -> npt.NDArray[Any]:
    """All points in a row, without what pads the rows of an organized cloud."""
    dtype = dtype_from_fields(cloud.fields, point_step=cloud.point_step)
    data = np.ascontiguousarray(as_view(cloud.data, "uint8")).reshape(-1)
    height, width, row = cloud.height, cloud.width, cloud.width * cloud.point_step
    size = len(data)
    padded = height > 1 and cloud.row_step > row
    needed = (cloud.row_step * (height - 1) + row) if padded else row * height
    _check(size >= needed, f"{size} bytes are too few for {width} x {height} points of {cloud.point_step} bytes")
    if not needed:
        return np.empty(0 if not row else width * height, dtype)
    if not padded:
        return np.ndarray((width * height,), dtype, data)
    rows: npt.NDArray[Any] = np.ndarray((height, width), dtype, data, strides=(cloud.row_step, cloud.point_step))
    return rows.reshape(-1)


def _structured(points: npt.NDArray[Any], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    columns = len(dtype.names or ())
    _check(
        points.ndim > 1 and points.shape[-1] == columns,
        f"an array of {points.shape} has no {columns} columns, one a field",
    )
    if not points.size:
        return np.empty(points.shape[:-1], dtype)
    made: npt.NDArray[Any] = unstructured_to_structured(points, dtype=dtype)
    return made


def _check(good: bool, why: str) -> None:
    if not good:
        raise AssertionError(why)
