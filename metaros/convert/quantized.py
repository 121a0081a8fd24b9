"""numpy ↔ metaros_msgs/QuantizedCloud: seven bytes a point in place of sixteen and more, for slow links.

x, y, z are each origin + step × a 16-bit number, so a cloud has an error of half a step at most; then, where there is
any, one byte of intensity a point.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.convert.points import numpy_to_points, points_to_numpy, points_xyz
from metaros.convert.stamps import header
from metaros.errors import DecodeError, FieldError
from metaros.idl.arrays import as_array
from metaros.interfaces.metaros_msgs.msg import QuantizedCloud
from metaros.interfaces.sensor_msgs.msg import PointCloud2

__all__ = ["numpy_to_quantized", "points_to_quantized", "quantized_to_numpy", "quantized_to_points"]

_STEPS: Final = 65_535
_LARGEST: Final = float(np.finfo(np.float32).max)
_POINT: Final = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
_POINT_I: Final = np.dtype([*_POINT.descr, ("intensity", "<f4")])


def numpy_to_quantized(
    points: npt.NDArray[Any], *, step_m: float = 0.01, stamp_ns: int = 0, frame_id: str = ""
) -> QuantizedCloud:
    """A cloud of a structured array with x, y, z and maybe intensity (0 to 255, cut and rounded), or columns of them.

    Points that are no numbers, or infinite, are left out. A cloud wider than 65535 steps gets a wider step.
    """
    if not (math.isfinite(step_m) and step_m > 0):
        raise FieldError(f"step_m must be above 0, not {step_m}")
    cloud = (points if points.dtype.names else points_to_numpy(numpy_to_points(points))).reshape(-1)
    names = cloud.dtype.names or ()
    if not {"x", "y", "z"} <= set(names):
        raise FieldError(f"a cloud needs x, y and z; it has {', '.join(names)}")
    xyz = np.stack([cloud[name] for name in "xyz"], axis=1).astype(np.float64)
    finite = np.isfinite(xyz).all(axis=1)
    xyz = xyz[finite]
    if not len(xyz):
        return QuantizedCloud(header=header(stamp_ns, frame_id), step_m=step_m, has_intensity="intensity" in names)
    origin = xyz.min(axis=0)
    step = _step(step_m, float((xyz.max(axis=0) - origin).max()))
    grid = np.clip(np.rint((xyz - origin) / step), 0, _STEPS).astype("<u2")
    parts = [grid.tobytes()]
    if "intensity" in names:
        strength = np.nan_to_num(cloud["intensity"][finite].astype(np.float64), nan=0.0, posinf=255, neginf=0)
        parts.append(np.clip(np.rint(strength), 0, 255).astype(np.uint8).tobytes())
    return QuantizedCloud(
        header=header(stamp_ns, frame_id),
        count=len(xyz),
        origin=origin,
        step_m=step,
        has_intensity="intensity" in names,
        data=b"".join(parts),
    )


def quantized_to_numpy(message: Any) -> npt.NDArray[Any]:
    """The points as a structured array of float32: x, y, z and, where the cloud has it, intensity."""
    count, step, origin = int(message.count), float(message.step_m), np.asarray(message.origin, np.float64)
    data = np.ascontiguousarray(as_array(message.data, "uint8")).reshape(-1)
    needed = count * (7 if message.has_intensity else 6)
    if data.size < needed:
        raise DecodeError(f"{data.size} bytes are too few for {count} points, which take {needed}")
    if not (math.isfinite(step) and step > 0 and np.isfinite(origin).all()):
        raise DecodeError(f"a cloud of step {step} from {origin.tolist()}")
    grid = data[: count * 6].view("<u2").reshape(count, 3)
    points = np.empty(count, _POINT_I if message.has_intensity else _POINT)
    for axis, name in enumerate("xyz"):
        points[name] = np.clip(origin[axis] + grid[:, axis] * step, -_LARGEST, _LARGEST)
    if message.has_intensity:
        points["intensity"] = data[count * 6 : needed]
    return points


def points_to_quantized(message: Any, *, step_m: float = 0.01) -> QuantizedCloud:
    """A PointCloud2 as a QuantizedCloud of the same header."""
    points = points_to_numpy(message).reshape(-1)
    points_xyz(message)  # says what is wrong with its coordinates
    made = numpy_to_quantized(points, step_m=step_m)
    made.header = message.header
    return made


def quantized_to_points(message: Any) -> PointCloud2:
    """A QuantizedCloud as a PointCloud2 of the same header."""
    made = numpy_to_points(quantized_to_numpy(message))
    made.header = message.header
    return made


def _step(wanted_m: float, extent_m: float) -> float:
    """As float32 has it, and wide enough."""
    step = np.float32(wanted_m)
    if extent_m > float(step) * _STEPS:
        step = np.nextafter(np.float32(extent_m / _STEPS), np.float32(np.inf))
    return float(step)
