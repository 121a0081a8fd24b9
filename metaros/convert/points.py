"""numpy ↔ sensor_msgs/PointCloud2: structured arrays with any fields, or plain columns x, y, z and more."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numpy.lib.recfunctions import unstructured_to_structured

from metaros.convert.stamps import header
from metaros.errors import DecodeError, FieldError
from metaros.idl.arrays import as_array
from metaros.interfaces.sensor_msgs.msg import PointCloud2, PointField

__all__ = ["numpy_to_points", "points_rgb", "points_to_numpy", "points_xyz"]

_TYPES: Final = ("", "i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")  # by PointField's numbers
_COLUMNS: Final = {3: ("x", "y", "z"), 4: ("x", "y", "z", "intensity")}
_MAX_FIELDS: Final = 256
_MAX_STEP: Final = 1 << 20
_BIG: Final = sys.byteorder == "big"


def numpy_to_points(
    points: npt.NDArray[Any],
    *,
    fields: Sequence[str] = (),
    rgb: npt.NDArray[Any] | None = None,
    stamp_ns: int = 0,
    frame_id: str = "",
) -> PointCloud2:
    """A cloud of a structured array, or of columns: (n, 3) is x, y, z; (n, 4) has intensity; others need `fields`.

    An image of points, (height, width) structured or (height, width, columns), keeps its rows. `rgb` is one uint8
    triple for each point. Contiguous arrays of this machine's byte order are not copied, unless `rgb` is added.
    """
    cloud = points if points.dtype.names else _structured(points, fields)
    if cloud.ndim not in (1, 2):
        raise FieldError(f"a cloud has one dimension or two, height and width, not {cloud.ndim}")
    if rgb is not None:
        cloud = _with_rgb(cloud, rgb)
    described = [_describe(name, cloud.dtype) for name in cloud.dtype.names or ()]
    height, width = cloud.shape if cloud.ndim == 2 else (1, cloud.shape[0])
    step = cloud.dtype.itemsize
    rows = np.ascontiguousarray(cloud).reshape(-1)
    return PointCloud2(
        header=header(stamp_ns, frame_id),
        height=height,
        width=width,
        fields=described,
        is_bigendian=_BIG,
        point_step=step,
        row_step=step * width,
        data=rows.view(np.uint8) if rows.size else np.empty(0, np.uint8),
        is_dense=_dense(rows),
    )


def points_to_numpy(message: Any) -> npt.NDArray[Any]:
    """The points as a structured array, (n,) or for an image of points (height, width): a view of the message's bytes.

    Of a cloud in the other byte order it is a copy.
    """
    height, width, step, row = message.height, message.width, message.point_step, message.row_step
    other = bool(message.is_bigendian) != _BIG
    dtype = _dtype(message, other=other)
    if height > 1 and row < step * width:
        raise DecodeError(f"rows of {row} bytes are too short for {width} points of {step} bytes")
    data = as_array(message.data, "uint8")
    data = np.ascontiguousarray(data).reshape(-1)
    stride = row if height > 1 else step * width
    needed = stride * (height - 1) + step * width if height and width else 0
    if data.size < needed:
        raise DecodeError(f"{data.size} bytes are too few for {height} x {width} points, which take {needed}")
    if not needed:
        return np.empty((height, width) if height > 1 else (0,), dtype.newbyteorder("=") if other else dtype)
    points: npt.NDArray[Any] = np.ndarray((height, width), dtype, data, strides=(stride, step))
    points = points[0] if height == 1 else points
    native: npt.NDArray[Any] = points.astype(dtype.newbyteorder("=")) if other else points
    return native


def points_xyz(message: Any, *, skip_nan: bool = False) -> npt.NDArray[Any]:
    """The coordinates as (n, 3), or (height, width, 3); a view where x, y, z lie side by side.

    `skip_nan` leaves out points with a coordinate that is no number, or infinite: the rest as (m, 3).
    """
    points = points_to_numpy(message)
    xyz = _columns(points, ("x", "y", "z"))
    if not skip_nan:
        return xyz
    xyz = xyz.reshape(-1, 3)
    finite: npt.NDArray[Any] = xyz[np.isfinite(xyz).all(axis=1)]
    return finite


def points_rgb(message: Any) -> npt.NDArray[np.uint8]:
    """The colours of the points as uint8 (n, 3), or (height, width, 3), from the packed field `rgb` or `rgba`."""
    points = points_to_numpy(message)
    names = points.dtype.names or ()
    name = next((item for item in ("rgb", "rgba") if item in names), None)
    if name is None or points.dtype[name] not in (np.dtype("f4"), np.dtype("u4"), np.dtype("i4")):
        raise DecodeError(f"the cloud has no packed colours; its fields are {', '.join(names) or 'none'}")
    packed = np.ascontiguousarray(points[name]).view(np.uint32)
    return np.stack([(packed >> shift) & 0xFF for shift in (16, 8, 0)], axis=-1).astype(np.uint8)


def _structured(points: npt.NDArray[Any], fields: Sequence[str]) -> npt.NDArray[Any]:
    """Columns of one type as a structured array of the same memory."""
    if points.ndim not in (2, 3):
        raise FieldError(f"points are (n, columns) or (height, width, columns), not of {points.ndim} dimensions")
    names = tuple(fields) or _COLUMNS.get(points.shape[-1], ())
    if len(names) != points.shape[-1] or len(set(names)) != len(names) or not all(names):
        raise FieldError(f"{points.shape[-1]} columns need as many names: fields={tuple(fields)!r}")
    kind = points.dtype.newbyteorder("=")
    if kind.str[1:] not in _TYPES:
        raise FieldError(f"a cloud cannot hold {points.dtype.name}; use float32")
    rows = np.ascontiguousarray(points, kind)
    return unstructured_to_structured(rows, np.dtype([(name, kind) for name in names]), copy=False)


def _with_rgb(cloud: npt.NDArray[Any], rgb: npt.NDArray[Any]) -> npt.NDArray[Any]:
    if rgb.dtype != np.uint8 or rgb.shape != (*cloud.shape, 3):
        raise FieldError(f"rgb: {rgb.dtype.name} of shape {rgb.shape}, where uint8 of {(*cloud.shape, 3)} is due")
    names = cloud.dtype.names or ()
    if "rgb" in names:
        raise FieldError("rgb: the points have a field of this name")
    wide = np.empty(cloud.shape, np.dtype([*((name, cloud.dtype[name]) for name in names), ("rgb", np.float32)]))
    for name in names:
        wide[name] = cloud[name]
    parts = rgb.astype(np.uint32)
    wide["rgb"] = ((parts[..., 0] << 16) | (parts[..., 1] << 8) | parts[..., 2]).view(np.float32)
    return wide


def _describe(name: str, dtype: np.dtype[Any]) -> PointField:
    assert dtype.fields is not None
    field, offset = dtype.fields[name][:2]
    base, shape = field.subdtype or (field, ())
    if base.str[1:] not in _TYPES or len(shape) > 1 or (base.itemsize > 1 and not base.isnative):
        raise FieldError(f"{name}: a cloud cannot hold {field}: numbers in this machine's order, no int64")
    return PointField(name=name, offset=offset, datatype=_TYPES.index(base.str[1:]), count=shape[0] if shape else 1)


def _dtype(message: Any, *, other: bool) -> np.dtype[Any]:
    step, fields = message.point_step, message.fields
    if not fields or len(fields) > _MAX_FIELDS or not 0 < step <= _MAX_STEP:
        raise DecodeError(f"{len(fields)} fields in points of {step} bytes")
    names, formats, offsets = [], [], []
    for field in fields:
        if not 0 < field.datatype < len(_TYPES) or not field.name or field.name in names:
            raise DecodeError(f"the field {field.name[:40]!r} of type {field.datatype} has no sound type or name")
        count = field.count or 1  # some drivers write 0
        kind = np.dtype(("<>"[other != _BIG]) + _TYPES[field.datatype])
        if field.offset + kind.itemsize * count > step:
            raise DecodeError(f"the field {field.name!r} ends behind the {step} bytes of a point")
        names.append(field.name)
        formats.append((kind, (count,)) if count > 1 else kind)
        offsets.append(field.offset)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": step})


def _columns(points: npt.NDArray[Any], names: tuple[str, ...]) -> npt.NDArray[Any]:
    present = points.dtype.names or ()
    if any(name not in present for name in names):
        raise DecodeError(f"the cloud has no {', '.join(names)}; its fields are {', '.join(present) or 'none'}")
    assert points.dtype.fields is not None
    kinds = {points.dtype[name] for name in names}
    offsets = [points.dtype.fields[name][1] for name in names]
    (kind, *more) = kinds
    if kind.subdtype:
        raise DecodeError("x, y and z are one number a point")
    if not more and offsets == [offsets[0] + kind.itemsize * index for index in range(3)]:
        one: Any = {
            "names": ["xyz"],
            "formats": [(kind, (3,))],
            "offsets": [offsets[0]],
            "itemsize": points.dtype.itemsize,
        }
        side_by_side: npt.NDArray[Any] = points.view(np.dtype(one))["xyz"]
        return side_by_side
    return np.stack([points[name] for name in names], axis=-1)


def _dense(rows: npt.NDArray[Any]) -> bool:
    """Whether every coordinate is a finite number."""
    names = [name for name in ("x", "y", "z") if name in (rows.dtype.names or ())]
    return all(bool(np.isfinite(rows[name]).all()) for name in names)
