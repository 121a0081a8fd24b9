"""numpy ↔ sensor_msgs/CompressedImage: JPEG and PNG, by OpenCV. The size is read from the file before it is decoded."""

from __future__ import annotations

import struct
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.convert.encodings import Encoding, encoding_of
from metaros.convert.image import recolour
from metaros.convert.opencv import opencv
from metaros.convert.stamps import header
from metaros.errors import DecodeError, FieldError, TooLargeError
from metaros.idl.arrays import as_array
from metaros.interfaces.sensor_msgs.msg import CompressedImage
from metaros.limits import LIMITS

__all__ = ["compressed_to_numpy", "image_file_size", "numpy_to_compressed"]

_PNG: Final = b"\x89PNG\r\n\x1a\n"
_JPEG: Final = b"\xff\xd8\xff"
_FRAMES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # the JPEG segments that say the size
_BARE: Final = frozenset({0x01, *range(0xD0, 0xD9)})  # segments without a length


def numpy_to_compressed(
    array: npt.NDArray[Any],
    format: str = "jpeg",  # noqa: A002 - the field's name
    *,
    encoding: str = "",
    quality: int = 80,
    stamp_ns: int = 0,
    frame_id: str = "",
) -> CompressedImage:
    """Pixels as JPEG of that quality (1 to 100) or as PNG, which also takes 16 bits.

    `encoding` is what the pixels are: without it mono8 or mono16 for a flat image, bgr8 or bgra8 for colours.
    """
    if format not in ("jpeg", "png"):
        raise FieldError(f"format: {format!r} is neither 'jpeg' nor 'png'")
    if not 1 <= quality <= 100:
        raise FieldError(f"quality: {quality} is not between 1 and 100")
    cv2 = opencv()
    pixels = _as_opencv(array, encoding, format)
    options = [cv2.IMWRITE_JPEG_QUALITY, quality] if format == "jpeg" else []
    try:
        good, data = cv2.imencode(".jpg" if format == "jpeg" else ".png", pixels, options)
    except cv2.error as error:
        raise FieldError(f"OpenCV cannot make a {format} of {pixels.shape} {pixels.dtype}: {error}") from None
    if not good:
        raise FieldError(f"OpenCV cannot make a {format} of {pixels.shape} {pixels.dtype}")
    return CompressedImage(header=header(stamp_ns, frame_id), format=format, data=np.asarray(data).reshape(-1))


def compressed_to_numpy(message: Any, encoding: str = "") -> npt.NDArray[Any]:
    """The pixels of a JPEG or PNG: (height, width) if it is grey, else (height, width, 3 or 4) in OpenCV's order, BGR.

    `encoding` asks for one kind whatever the file holds, such as "rgb8" or "mono8". `TooLargeError`, before anything
    is decoded, for more than `LIMITS.image_pixels`; `DecodeError` for what is no whole JPEG or PNG.
    """
    data = as_array(message.data, "uint8")
    file = data.tobytes()
    width, height = image_file_size(file[: 1 << 20])
    if width * height > LIMITS.image_pixels:
        raise TooLargeError(f"an image of {width} x {height} pixels: the limit is {LIMITS.image_pixels} pixels")
    if file.startswith(_PNG):
        _check_chunks(file)
    cv2 = opencv()
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise DecodeError(f"OpenCV cannot decode the image: {error}") from None
    if pixels is None:
        raise DecodeError("the image is damaged: OpenCV cannot decode it")
    found: npt.NDArray[Any] = pixels
    return recolour(found, _kind(found), encoding) if encoding else found


def image_file_size(data: bytes) -> tuple[int, int]:
    """Width and height that a JPEG or PNG names in its first bytes, or `DecodeError`."""
    if data.startswith(_PNG):
        if len(data) < 24 or data[12:16] != b"IHDR":
            raise DecodeError("a PNG without a header")
        width, height = struct.unpack_from(">II", data, 16)
    elif data.startswith(_JPEG):
        width, height = _jpeg_size(data)
    else:
        raise DecodeError(f"bytes that begin with {data[:8].hex()} are neither JPEG nor PNG")
    if not width or not height:
        raise DecodeError(f"an image of {width} x {height} pixels")
    return width, height


def _check_chunks(data: bytes) -> None:
    """Refuse a PNG that is not whole: OpenCV takes as much memory as the length of a chunk says, up to 4 GiB."""
    position = len(_PNG)
    while position + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, position)
        position += 12 + length
        if kind == b"IEND" and position <= len(data):
            return
    raise DecodeError("the image is damaged: a PNG that is not whole")


def _jpeg_size(data: bytes) -> tuple[int, int]:
    position = 2
    while position + 9 <= len(data) and data[position] == 0xFF:
        marker = data[position + 1]
        if marker == 0xFF:
            position += 1
        elif marker in _BARE:
            position += 2
        elif marker in _FRAMES:
            height, width = struct.unpack_from(">HH", data, position + 5)
            return width, height
        else:
            length = struct.unpack_from(">H", data, position + 2)[0]
            if length < 2:
                break
            position += 2 + length
    raise DecodeError("a JPEG without a size")


def _as_opencv(array: npt.NDArray[Any], encoding: str, file_format: str) -> npt.NDArray[Any]:
    """The pixels in the order that OpenCV writes."""
    kind = encoding_of(encoding) if encoding else _kind(array)
    if kind is None or not kind.colours:
        raise FieldError(f"{encoding!r} is none of mono8, rgb8, bgr8, rgba8, bgra8, mono16")
    channels = array.shape[2] if array.ndim == 3 else 1
    if array.dtype != kind.dtype or channels != kind.channels:
        raise FieldError(f"the pixels are {channels} x {array.dtype.name}, which is not {kind.name}")
    if file_format == "jpeg" and (kind.dtype.itemsize > 1 or kind.channels == 4):
        raise FieldError(f"a JPEG cannot hold {kind.name}; use PNG, or convert it to bgr8")
    if kind.colours in ("rgb", "rgba"):
        return recolour(array, kind, kind.name.replace("rgb", "bgr"))
    return np.ascontiguousarray(array)


def _kind(array: npt.NDArray[Any]) -> Encoding:
    """What an array of OpenCV's is."""
    channels = array.shape[2] if array.ndim == 3 else 1
    depth = {"uint8": "8", "uint16": "16"}.get(array.dtype.name, "")
    name = {1: "mono", 3: "bgr", 4: "bgra"}.get(channels, "")
    kind = encoding_of(f"{name}{depth}") if name and depth and array.ndim in (2, 3) else None
    if kind is None:
        raise FieldError(f"{array.dtype.name} of shape {array.shape} are no pixels of a JPEG or PNG")
    return kind
