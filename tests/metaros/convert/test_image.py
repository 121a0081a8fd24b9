"""Images: every plain encoding there and back, padded rows, the other byte order, colours."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.cdr import codec
from metaros.convert import image_to_numpy, numpy_to_image
from metaros.convert.encodings import encoding_of
from metaros.errors import DecodeError, FieldError
from metaros.interfaces.sensor_msgs.msg import Image
from tests.support.tables import cases

ENCODINGS = [
    *(f"{name}{depth}" for name in ("mono", "rgb", "bgr", "rgba", "bgra") for depth in (8, 16)),
    *(f"bayer_{name}{depth}" for name in ("rggb", "bggr", "gbrg", "grbg") for depth in (8, 16)),
    *(f"{kind}C{n}" for kind in ("8U", "8S", "16U", "16S", "32S", "32F", "64F") for n in (1, 2, 3, 4, 7)),
    "32FC",
    "yuv422",
    "uyvy",
    "yuyv",
    "yuv422_yuy2",
]


def picture(encoding: str, height: int = 4, width: int = 6) -> Any:
    kind = encoding_of(encoding)
    assert kind is not None
    count = height * width * kind.channels
    values = (np.arange(count) * 37 % 251).astype(kind.dtype)
    return values.reshape((height, width, kind.channels) if kind.channels > 1 else (height, width))


@cases("encoding", ENCODINGS)
def test_pixels_come_back_over_the_wire_uncopied(encoding: str) -> None:
    pixels = picture(encoding)
    message = numpy_to_image(pixels, encoding, stamp_ns=1_500_000_000, frame_id="cam")
    assert np.shares_memory(message.data, pixels)
    assert (message.header.stamp.sec, message.header.stamp.nanosec, message.header.frame_id) == (1, 500_000_000, "cam")
    back = image_to_numpy(codec(Image).decode(codec(Image).encode(message)))
    assert (back.dtype, back.shape) == (pixels.dtype, pixels.shape)
    assert (back == pixels).all()


@cases("encoding", ["mono8", "mono16", "bgr8", "32FC3", "rgba16"])
@cases("padding", [1, 5, 64])
def test_padding_at_row_ends_is_left_out_without_a_copy(encoding: str, padding: int) -> None:
    pixels = picture(encoding)
    message = numpy_to_image(pixels, encoding)
    rows = message.data.reshape(4, -1)
    padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=99).reshape(-1)
    message.data, message.step = padded, message.step + padding
    back = image_to_numpy(message)
    assert np.shares_memory(back, padded)
    assert (back == pixels).all()
    message.data = padded[:-padding]  # the last row needs none
    assert (image_to_numpy(message) == pixels).all()


@cases("encoding", ["mono16", "bgr16", "32FC1", "64FC2", "16SC3"])
def test_the_other_byte_order_is_turned(encoding: str) -> None:
    pixels = picture(encoding)
    message = numpy_to_image(pixels, encoding)
    message.is_bigendian = sys.byteorder != "big"
    message.data = pixels.byteswap().reshape(-1).view(np.uint8)
    assert (image_to_numpy(message) == pixels).all()
    assert image_to_numpy(message).dtype.isnative


def test_cut_out_and_foreign_arrays_are_taken() -> None:
    pixels = picture("bgr8", 10, 12)[2:7, 3:9]
    assert (image_to_numpy(numpy_to_image(pixels, "bgr8")) == pixels).all()
    swapped = picture("mono16").astype(np.dtype("u2").newbyteorder("S"))
    assert (image_to_numpy(numpy_to_image(swapped)) == swapped).all()
    assert image_to_numpy(numpy_to_image(np.zeros((0, 5), np.uint8))).shape == (0, 5)


@cases(("dtype", "encoding"), [("u1", "mono8"), ("u2", "mono16"), ("i2", "16SC1"), ("f4", "32FC1"), ("f8", "64FC1")])
def test_flat_images_need_no_encoding(dtype: str, encoding: str) -> None:
    assert numpy_to_image(np.zeros((2, 3), dtype)).encoding == encoding


def test_colours_are_reordered() -> None:
    bgr = picture("bgr8")
    message = numpy_to_image(bgr, "bgr8")
    assert (image_to_numpy(message, "rgb8") == bgr[..., ::-1]).all()
    rgba = image_to_numpy(message, "rgba8")
    assert (rgba[..., :3] == bgr[..., ::-1]).all()
    assert (rgba[..., 3] == 255).all()
    red = np.zeros((1, 1, 3), np.uint8)
    red[..., 0] = 255
    assert image_to_numpy(numpy_to_image(red, "rgb8"), "mono8").tolist() == [[76]]
    grey = picture("mono16")
    assert (image_to_numpy(numpy_to_image(grey), "bgr16")[..., 1] == grey).all()


@cases("encoding", ["bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"])
def test_a_bayer_pattern_of_pure_red_is_red(encoding: str) -> None:
    pytest.importorskip("cv2")
    pattern = np.array([[255 * (letter == "r") for letter in encoding[6:10]]], np.uint8).reshape(2, 2)
    message = numpy_to_image(np.tile(pattern, (8, 8)), encoding)
    assert image_to_numpy(message, "rgb8")[8, 8].tolist() == [255, 0, 0]
    assert image_to_numpy(message, "bgr8")[8, 8].tolist() == [0, 0, 255]


def test_yuv_becomes_colours() -> None:
    pytest.importorskip("cv2")
    yuyv = np.empty((2, 4, 2), np.uint8)
    yuyv[..., 0], yuyv[..., 1] = 235, 128  # white
    assert (image_to_numpy(numpy_to_image(yuyv, "yuv422_yuy2"), "bgr8") == 255).all()
    assert (image_to_numpy(numpy_to_image(yuyv[..., ::-1], "uyvy"), "rgb8") == 255).all()


@cases(
    ("shape", "dtype", "encoding", "message"),
    [
        ((2, 3, 3), "u1", "", 'say which encoding, such as "bgr8"'),
        ((2, 3, 3), "u1", "mono8", "mono8 is 1 channel of uint8, not 3 channels of uint8"),
        ((2, 3), "f4", "mono8", "mono8 is 1 channel of uint8, not 1 channel of float32"),
        ((2, 3), "u1", "nv12", "is no image encoding that is a plain array"),
        ((2,), "u1", "mono8", "an image has 2 or 3 dimensions, not 1"),
        ((2, 3), "i8", "", "say which encoding"),
    ],
)
def test_what_is_no_image_is_refused(shape: Any, dtype: str, encoding: str, message: str) -> None:
    with pytest.raises(FieldError, match=message):
        numpy_to_image(np.zeros(shape, dtype), encoding)


@cases(
    ("change", "message"),
    [
        ({"encoding": "h264"}, "is no array of pixels that is known here"),
        ({"encoding": "8UC99"}, "is no array of pixels that is known here"),
        ({"step": 5}, "rows of 5 bytes are too short for 6 pixels of mono8"),
        ({"height": 5}, "24 bytes are too few for 5 rows of 6 bytes"),
        ({"width": 2**32 - 1, "height": 2**32 - 1, "step": 2**32 - 1}, "are too few"),
    ],
)
def test_an_image_that_contradicts_itself_is_a_decode_error(change: dict[str, Any], message: str) -> None:
    image = numpy_to_image(picture("mono8"))
    for name, value in change.items():
        setattr(image, name, value)
    with pytest.raises(DecodeError, match=message):
        image_to_numpy(image)


def test_colours_that_cannot_be_are_said() -> None:
    with pytest.raises(FieldError, match="32FC1 cannot become bgr8"):
        image_to_numpy(numpy_to_image(picture("32FC1")), "bgr8")
    with pytest.raises(FieldError, match="is no colour encoding"):
        image_to_numpy(numpy_to_image(picture("mono8")), "32FC1")


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(ENCODINGS),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**32 - 1),
    st.booleans(),
    st.binary(max_size=200),
)
def test_any_image_is_pixels_or_a_decode_error(encoding, height, width, step, big, data):
    image = Image(encoding=encoding, height=height, width=width, step=step, is_bigendian=big, data=data)
    try:
        pixels = image_to_numpy(image)
    except DecodeError:
        return
    assert pixels.shape[:2] == (height, width)
    assert pixels.size == 0 or pixels.nbytes <= len(data)
