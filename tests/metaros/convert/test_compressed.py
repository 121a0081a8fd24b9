"""JPEG and PNG by OpenCV, and what is refused before it is decoded."""

from __future__ import annotations

import struct
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.cdr import codec
from metaros.convert import compressed_to_numpy, numpy_to_compressed
from metaros.convert.compressed import image_file_size
from metaros.errors import ConfigError, DecodeError, FieldError, TooLargeError
from metaros.interfaces.sensor_msgs.msg import CompressedImage
from tests.support.tables import cases

PNG_HEAD = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"


def gradient(channels: int = 3, dtype: str = "u1") -> Any:
    ramp = np.linspace(0, np.iinfo(dtype).max, 32).astype(dtype)
    planes = np.broadcast_to(ramp[None, :, None], (24, 32, channels)).copy()
    if channels > 1:
        planes[..., 0] = 10
    return planes if channels > 1 else planes[..., 0]


@cases(
    ("channels", "dtype", "encoding"), [(1, "u1", ""), (3, "u1", ""), (4, "u1", ""), (1, "u2", ""), (3, "u1", "rgb8")]
)
def test_png_gives_the_very_pixels_back(channels: int, dtype: str, encoding: str) -> None:
    pytest.importorskip("cv2")
    pixels = gradient(channels, dtype)
    message = numpy_to_compressed(pixels, "png", encoding=encoding, stamp_ns=2_000_000_001, frame_id="cam")
    assert (message.format, message.header.stamp.sec, message.header.frame_id) == ("png", 2, "cam")
    received = codec(CompressedImage).decode(codec(CompressedImage).encode(message))
    assert (compressed_to_numpy(received, encoding) == pixels).all()
    assert image_file_size(received.data.tobytes()) == (32, 24)


@cases("channels", [1, 3])
def test_jpeg_comes_close_and_colours_keep_their_places(channels: int) -> None:
    pytest.importorskip("cv2")
    pixels = gradient(channels)
    message = numpy_to_compressed(pixels, quality=95)
    back = compressed_to_numpy(message)
    assert back.shape == pixels.shape
    assert np.abs(back.astype(int) - pixels).mean() < 6
    assert image_file_size(message.data.tobytes()) == (32, 24)
    if channels == 3:
        assert (compressed_to_numpy(message, "rgb8") == back[..., ::-1]).all()
        assert compressed_to_numpy(message, "mono8").shape == (24, 32)
    small = numpy_to_compressed(np.random.default_rng(1).integers(0, 255, (64, 64, 3), np.uint8), quality=5)
    large = numpy_to_compressed(np.random.default_rng(1).integers(0, 255, (64, 64, 3), np.uint8), quality=95)
    assert small.data.size < large.data.size


def test_a_bomb_is_refused_by_its_header_alone() -> None:
    bomb = PNG_HEAD + struct.pack(">II", 100_000, 100_000) + b"\x08\x02\0\0\0"
    with pytest.raises(TooLargeError, match="100000 x 100000 pixels: the limit is 40000000"):
        compressed_to_numpy(CompressedImage(format="png", data=bomb))
    jpeg = b"\xff\xd8\xff\xe0\0\x04ab\xff\xff\xc2\0\x11\x08" + struct.pack(">HH", 65535, 65535) + b"\3" * 12
    with pytest.raises(TooLargeError, match="65535 x 65535"):
        compressed_to_numpy(CompressedImage(format="jpeg", data=jpeg))


@cases(
    "data",
    [
        b"",
        b"GIF89a",
        b"\xff\xd8\xff",
        b"\xff\xd8\xff\xe0\0\0",
        b"\xff\xd8\xff\xe0\0\0" + bytes(16),  # a segment shorter than its own length
        b"\xff\xd8\xff\xe0\0\1" + bytes(16),
        PNG_HEAD,
        PNG_HEAD + bytes(8),
        b"\xff\xd8\xff\xd9",
    ],
)
def test_what_is_no_image_file_is_a_decode_error(data: bytes) -> None:
    with pytest.raises(DecodeError):
        compressed_to_numpy(CompressedImage(data=data))


def test_a_damaged_file_is_a_decode_error() -> None:
    pytest.importorskip("cv2")
    with pytest.raises(DecodeError, match="a PNG that is not whole"):
        compressed_to_numpy(CompressedImage(data=PNG_HEAD + struct.pack(">II", 4, 4) + b"\x08\x02\0\0\0" + bytes(40)))
    end = bytes(4) + bytes(4) + b"IEND" + bytes(4)
    with pytest.raises(DecodeError, match="OpenCV cannot decode"):
        compressed_to_numpy(CompressedImage(data=PNG_HEAD + struct.pack(">II", 4, 4) + b"\x08\x02\0\0\0" + end))


@cases(
    ("pixels", "options", "message"),
    [
        (gradient(), {"format": "gif"}, "format: 'gif' is neither"),
        (gradient(), {"quality": 0}, "quality: 0 is not between 1 and 100"),
        (gradient(4), {}, "a JPEG cannot hold bgra8"),
        (gradient(1, "u2"), {}, "a JPEG cannot hold mono16"),
        (gradient(), {"encoding": "mono8"}, "the pixels are 3 x uint8, which is not mono8"),
        (gradient(), {"encoding": "32FC1"}, "is none of mono8"),
        (np.zeros((2, 2), "f4"), {}, "float32 of shape"),
    ],
)
def test_pixels_that_no_file_holds_are_refused(pixels: Any, options: dict[str, Any], message: str) -> None:
    pytest.importorskip("cv2")
    with pytest.raises(FieldError, match=message):
        numpy_to_compressed(pixels, **options)


def test_without_opencv_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(ConfigError, match=r"install metaros with its extra `drivers`"):
        numpy_to_compressed(gradient())


@settings(max_examples=150, deadline=None)
@given(st.sampled_from([b"", PNG_HEAD, b"\xff\xd8\xff", b"\xff\xd8\xff\xe0"]), st.binary(max_size=80))
def test_any_bytes_have_a_size_or_are_refused(head: bytes, tail: bytes) -> None:
    try:
        width, height = image_file_size(head + tail)
    except DecodeError:
        return
    assert width > 0
    assert height > 0
