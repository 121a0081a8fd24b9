"""`CvBridge`: between images of ROS and arrays as OpenCV has them."""

from __future__ import annotations

import array
import sys
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.convert.compressed import image_file_size
from metaros.convert.opencv import opencv
from metaros.errors import DecodeError
from metaros.idl.arrays import as_view
from metaros.limits import LIMITS
from metaros.ros2.cv_bridge.colours import NUMPY_NAMES, converted
from metaros.ros2.cv_bridge.encodings import DEPTHS, cv_type, layout_of, of_cv_type
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["CvBridge", "CvBridgeError", "cvtColor2", "getCvType"]

Pixels = npt.NDArray[Any]
_LITTLE: Final = sys.byteorder == "little"


class CvBridgeError(TypeError):
    """An image cannot be converted."""


class CvBridge:
    """Converts images. OpenCV itself is needed for compressed ones, Bayer patterns and YUV: `metaros[drivers]`."""

    def __init__(self) -> None:
        self.cvtype_to_name = {
            cv_type(depth, channels): f"{depth}C{channels}" for depth in DEPTHS for channels in (1, 2, 3, 4)
        }
        self.numpy_type_to_cvtype = {name: depth for depth, name in NUMPY_NAMES.items()} | NUMPY_NAMES

    # ── names of types

    def dtype_with_channels_to_cvtype2(self, dtype: Any, n_channels: int) -> str:
        """A numpy type and so many channels as an encoding such as 8UC3."""
        depth = self.numpy_type_to_cvtype.get(np.dtype(dtype).name)
        if depth is None:
            raise CvBridgeError(f"OpenCV has no images of {dtype}: {', '.join(NUMPY_NAMES.values())} are possible")
        return f"{depth}C{n_channels}"

    def cvtype2_to_dtype_with_channels(self, cvtype: int) -> tuple[str, int]:
        """OpenCV's number of a type as a numpy type and channels."""
        depth, channels = of_cv_type(cvtype)
        return NUMPY_NAMES[depth], channels

    def encoding_to_cvtype2(self, encoding: str) -> int:
        """OpenCV's number of the type that an encoding has. CvBridgeError where it is unknown."""
        try:
            return getCvType(encoding)
        except RuntimeError as error:
            raise CvBridgeError(error) from None

    def encoding_to_dtype_with_channels(self, encoding: str) -> tuple[str, int]:
        """The numpy type and the channels that an encoding has. CvBridgeError where it is unknown."""
        return self.cvtype2_to_dtype_with_channels(self.encoding_to_cvtype2(encoding))

    # ── images

    def imgmsg_to_cv2(self, img_msg: Any, desired_encoding: str = "passthrough") -> Pixels:
        """The pixels of a `sensor_msgs.msg.Image`: (height, width), or (height, width, channels) of several.

        "passthrough" leaves them as they are (the array may be a view of the message: what is drawn into it is drawn
        there); any other encoding converts.

        Raises:
            CvBridgeError: the encoding is unknown, the conversion makes no sense, or the image is too short.
        """
        name, channels = self.encoding_to_dtype_with_channels(img_msg.encoding)
        dtype: Any = np.dtype(name).newbyteorder(">" if img_msg.is_bigendian else "<")
        pixels = _pixels(img_msg, dtype, channels)
        if dtype.itemsize > 1 and bool(img_msg.is_bigendian) == _LITTLE:
            pixels = pixels.astype(np.dtype(name))
        if not pixels.flags.writeable:
            pixels = pixels.copy()
        if desired_encoding == "passthrough":
            return pixels
        try:
            return cvtColor2(pixels, img_msg.encoding, desired_encoding)
        except RuntimeError as error:
            raise CvBridgeError(error) from None

    def cv2_to_imgmsg(self, cvim: Any, encoding: str = "passthrough", header: Any = None) -> Any:
        """A `sensor_msgs.msg.Image` of the pixels, which are of that encoding; "passthrough" says no more than 8UC3.

        Raises:
            CvBridgeError: the array is not of that encoding.
            TypeError: it is no array.
        """
        if not isinstance(cvim, (np.ndarray, np.generic)):
            raise TypeError(f"Your input type is not a numpy array but {type(cvim).__name__}")
        image: Pixels = np.ascontiguousarray(cvim) if cvim.ndim else np.asarray(cvim)
        if image.ndim not in (2, 3):
            raise CvBridgeError(f"an image has 2 or 3 dimensions, not {image.ndim}")
        kind = self.dtype_with_channels_to_cvtype2(image.dtype, 1 if image.ndim < 3 else image.shape[2])
        if encoding == "passthrough":
            encoding = kind
        elif self.encoding_to_cvtype2(encoding) != getCvType(kind):
            raise CvBridgeError(f"encoding specified as {encoding}, but image has incompatible type {kind}")
        data = array.array("B")
        data.frombytes(image.tobytes())
        message = interface("sensor_msgs/msg/Image")()
        if header is not None:
            message.header = header
        message.height, message.width = image.shape[:2]
        message.encoding = encoding
        order = image.dtype.byteorder
        message.is_bigendian = order == ">" or (order == "=" and not _LITTLE)
        message.step = len(data) // message.height if message.height else 0
        message.data = data
        return message

    # ── compressed images

    def compressed_imgmsg_to_cv2(self, cmprs_img_msg: Any, desired_encoding: str = "passthrough") -> Pixels:
        """The pixels of a `sensor_msgs.msg.CompressedImage`; colours come as bgr8 or bgra8, or as `desired_encoding`.

        Raises:
            CvBridgeError: OpenCV cannot decode it, or it is too large (`LIMITS.image_pixels`).
        """
        cv2 = opencv()
        data = as_view(cmprs_img_msg.data, "uint8")
        _check_size(data)
        flag = cv2.IMREAD_ANYCOLOR if desired_encoding == "passthrough" else cv2.IMREAD_UNCHANGED
        try:
            pixels: Pixels | None = cv2.imdecode(data, flag)
        except cv2.error as error:
            raise CvBridgeError(f"OpenCV cannot decode the image: {error}") from None
        if pixels is None:
            raise CvBridgeError("OpenCV cannot decode the image: it is damaged, or of a format that is unknown")
        if desired_encoding == "passthrough":
            return pixels
        channels = 1 if pixels.ndim == 2 else pixels.shape[2]
        found = {1: "mono", 3: "bgr", 4: "bgra"}[channels] + ("16" if pixels.dtype == np.uint16 else "8")
        try:
            return cvtColor2(pixels, found, desired_encoding)
        except RuntimeError as error:
            raise CvBridgeError(error) from None

    def cv2_to_compressed_imgmsg(self, cvim: Any, dst_format: str = "jpg") -> Any:
        """A `sensor_msgs.msg.CompressedImage` in one of OpenCV's formats: jpg, png, bmp, tiff …

        Raises:
            CvBridgeError: OpenCV cannot.
            TypeError: it is no array.
        """
        if not isinstance(cvim, (np.ndarray, np.generic)):
            raise TypeError(f"Your input type is not a numpy array but {type(cvim).__name__}")
        cv2 = opencv()
        try:
            good, file = cv2.imencode(f".{dst_format}", cvim)
        except cv2.error as error:
            raise CvBridgeError(f"OpenCV cannot make a {dst_format} of {cvim.shape} {cvim.dtype}: {error}") from None
        if not good:
            raise CvBridgeError(f"OpenCV cannot make a {dst_format} of {cvim.shape} {cvim.dtype}")
        data = array.array("B")
        data.frombytes(file.tobytes())
        message = interface("sensor_msgs/msg/CompressedImage")(format=dst_format)
        message.data = data
        return message


def getCvType(encoding: str) -> int:
    """OpenCV's number of the type that an encoding has. RuntimeError where it is unknown."""
    layout = layout_of(encoding)
    if layout is None:
        raise RuntimeError(f"Unrecognized image encoding [{encoding}]")
    return cv_type(layout.depth, layout.channels)


def cvtColor2(pixels: Pixels, encoding_in: str, encoding_out: str) -> Pixels:
    """The pixels in another encoding. RuntimeError where that makes no sense."""
    try:
        return converted(pixels, encoding_in, encoding_out)
    except ValueError as error:
        raise RuntimeError(str(error)) from None


def _pixels(message: Any, dtype: np.dtype[Any], channels: int) -> Pixels:
    """A view of the message's bytes, without what pads its rows."""
    height, width, step = message.height, message.width, message.step
    row = width * channels * dtype.itemsize
    if height and step < row:
        raise CvBridgeError(f"Image is wrongly formed: rows of {step} bytes, and {width} pixels take {row}")
    data = np.ascontiguousarray(as_view(message.data, "uint8")).reshape(-1)
    if height and data.size < step * (height - 1) + row:
        raise CvBridgeError(f"Image is wrongly formed: {data.size} bytes for {height} rows of {step} bytes")
    shape = (height, width) if channels == 1 else (height, width, channels)
    if not height or not width:
        return np.empty(shape, dtype)
    size = dtype.itemsize
    return np.ndarray(shape, dtype, data, strides=(step, channels * size, size)[: len(shape)])


def _check_size(data: Pixels) -> None:
    """JPEG and PNG say their size first: one that would fill the memory is not decoded."""
    try:
        width, height = image_file_size(data[: 1 << 20].tobytes())
    except DecodeError:
        return  # another format, or a damaged file: OpenCV says
    if width * height > LIMITS.image_pixels:
        raise CvBridgeError(f"an image of {width} x {height} pixels: the limit is {LIMITS.image_pixels} pixels")
