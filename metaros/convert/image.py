"""numpy ↔ sensor_msgs/Image."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.convert.encodings import Encoding, encoding_of
from metaros.convert.opencv import opencv
from metaros.convert.stamps import header
from metaros.errors import DecodeError, FieldError
from metaros.idl.arrays import as_array
from metaros.interfaces.sensor_msgs.msg import Image

__all__ = ["image_to_numpy", "numpy_to_image", "recolour"]

_GUESSES = {"uint8": "mono8", "uint16": "mono16", "float32": "32FC1", "float64": "64FC1", "int16": "16SC1"}

# OpenCV names a Bayer pattern by its second row's second and third pixel.
_OPENCV_CODES = {
    "bayer_rggb": "BAYER_BG2BGR",
    "bayer_bggr": "BAYER_RG2BGR",
    "bayer_gbrg": "BAYER_GR2BGR",
    "bayer_grbg": "BAYER_GB2BGR",
    "yuv422": "YUV2BGR_UYVY",
    "uyvy": "YUV2BGR_UYVY",
    "yuv422_yuy2": "YUV2BGR_YUY2",
    "yuyv": "YUV2BGR_YUY2",
}


def numpy_to_image(array: npt.NDArray[Any], encoding: str = "", *, stamp_ns: int = 0, frame_id: str = "") -> Image:
    """An image of (height, width) or (height, width, channels) pixels; they are not copied if they lie in a row.

    Without `encoding` a flat image is mono8, mono16, 16SC1, 32FC1 or 64FC1; colours need it said whether they are
    "rgb8" or "bgr8", which is what OpenCV uses.
    """
    if array.ndim not in (2, 3):
        raise FieldError(f"an image has 2 or 3 dimensions, not {array.ndim}")
    channels = array.shape[2] if array.ndim == 3 else 1
    kind = _chosen(encoding, array.dtype, channels)
    if array.dtype.newbyteorder("=") != kind.dtype or channels != kind.channels:
        raise FieldError(f"{kind.name} is {_said(kind.dtype, kind.channels)}, not {_said(array.dtype, channels)}")
    rows = np.ascontiguousarray(array, dtype=kind.dtype)
    return Image(
        header=header(stamp_ns, frame_id),
        height=array.shape[0],
        width=array.shape[1],
        encoding=kind.name,
        is_bigendian=sys.byteorder == "big",
        step=array.shape[1] * channels * kind.dtype.itemsize,
        data=rows.reshape(-1).view(np.uint8),
    )


def image_to_numpy(message: Any, encoding: str = "") -> npt.NDArray[Any]:
    """The pixels as (height, width), or (height, width, channels) if there are several; without padding at row ends.

    A view of the message's bytes, unless they are of the other byte order. With `encoding` an array of its own in that
    order of colours: mono8, rgb8, bgr8, rgba8 or bgra8 (and 16) from any other of the same depth; bgr8 and rgb8 also
    from Bayer and YUV 4:2:2 images, by OpenCV.
    """
    kind = encoding_of(message.encoding)
    if kind is None:
        raise DecodeError(f"the image encoding {str(message.encoding)[:40]!r} is no array of pixels that is known here")
    pixels = _pixels(message, kind)
    if not encoding or encoding == kind.name:
        return pixels
    return recolour(pixels, kind, encoding)


def recolour(pixels: npt.NDArray[Any], kind: Encoding, wanted: str) -> npt.NDArray[Any]:
    """The pixels of one colour encoding in another."""
    target = encoding_of(wanted)
    if target is None or not target.colours:
        raise FieldError(f"{wanted!r} is no colour encoding: mono8, rgb8, bgr8, rgba8, bgra8, or with 16")
    if not kind.colours and kind.dtype == target.dtype:
        return _by_opencv(pixels, kind, target)
    if not kind.colours or kind.dtype != target.dtype:
        raise FieldError(f"{kind.name} cannot become {wanted}: colours of one depth only")
    planes = pixels.reshape((*pixels.shape[:2], kind.channels))
    if target.colours == "g":
        return _grey(planes, kind)
    if kind.colours == "g":
        planes, order = np.repeat(planes, 3, axis=2), "rgb"
    else:
        order = kind.colours
    out = np.empty((*planes.shape[:2], target.channels), target.dtype)
    for index, colour in enumerate(target.colours):
        out[..., index] = planes[..., order.index(colour)] if colour in order else np.iinfo(target.dtype).max
    return out


def _grey(planes: npt.NDArray[Any], kind: Encoding) -> npt.NDArray[Any]:
    """Luma by the weights of BT.601, as OpenCV's."""
    if kind.colours == "g":
        return planes[..., 0].copy()
    weights = {"r": 0.299, "g": 0.587, "b": 0.114}
    total = sum(planes[..., kind.colours.index(colour)] * np.float32(weight) for colour, weight in weights.items())
    return np.rint(total).astype(kind.dtype)


def _by_opencv(pixels: npt.NDArray[Any], kind: Encoding, target: Encoding) -> npt.NDArray[Any]:
    cv2 = opencv()
    code = _OPENCV_CODES.get(kind.name[:10] if kind.name.startswith("bayer_") else kind.name)
    if code is None or target.colours not in ("bgr", "rgb"):
        raise FieldError(f"{kind.name} cannot become {target.name}")
    found: npt.NDArray[Any] = cv2.cvtColor(np.ascontiguousarray(pixels), getattr(cv2, f"COLOR_{code}"))
    return found if target.colours == "bgr" else np.ascontiguousarray(found[..., ::-1])


def _pixels(message: Any, kind: Encoding) -> npt.NDArray[Any]:
    height, width, step, size = message.height, message.width, message.step, kind.dtype.itemsize
    row = width * kind.channels * size
    if step < row:
        raise DecodeError(f"rows of {step} bytes are too short for {width} pixels of {kind.name}, which take {row}")
    data = as_array(message.data, "uint8")
    if height and data.size < step * (height - 1) + row:
        raise DecodeError(f"{data.size} bytes are too few for {height} rows of {step} bytes")
    other = size > 1 and bool(message.is_bigendian) != (sys.byteorder == "big")
    dtype = kind.dtype.newbyteorder("S") if other else kind.dtype
    if data.ndim != 1 or not data.flags.c_contiguous:
        data = np.ascontiguousarray(data).reshape(-1)
    shape = (height, width, kind.channels)
    if not height or not width:
        return np.empty(shape if kind.channels > 1 else shape[:2], kind.dtype)
    pixels: npt.NDArray[Any] = np.ndarray(shape, dtype, data, strides=(step, kind.channels * size, size))
    if kind.channels == 1:
        pixels = pixels[..., 0]
    return pixels.astype(kind.dtype) if other else pixels


def _chosen(encoding: str, dtype: np.dtype[Any], channels: int) -> Encoding:
    name = encoding or (_GUESSES.get(dtype.newbyteorder("=").name, "") if channels == 1 else "")
    if not name:
        raise FieldError(f'{_said(dtype, channels)}: say which encoding, such as "bgr8", "rgb8" or "32FC2"')
    kind = encoding_of(name)
    if kind is None:
        raise FieldError(f"{name!r} is no image encoding that is a plain array of pixels")
    return kind


def _said(dtype: np.dtype[Any], channels: int) -> str:
    return f"{channels} channel{'s' if channels > 1 else ''} of {dtype.name}"
