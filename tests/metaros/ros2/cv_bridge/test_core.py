"""Images there and back, and what OpenCV itself would make of them."""

from __future__ import annotations

import array
import sys
from typing import Any

import numpy as np
import pytest

from metaros.ros2.cv_bridge import CvBridge, CvBridgeError, encodings
from metaros.ros2.rosidl.catalogue import interface

cv2 = pytest.importorskip("cv2")
BRIDGE = CvBridge()


def picture(*shape: int, dtype: Any = np.uint8, seed: int = 7) -> Any:
    rng = np.random.default_rng(seed)
    if np.dtype(dtype).kind == "f":
        return rng.normal(size=shape).astype(dtype)
    info = np.iinfo(dtype)
    return rng.integers(info.min, info.max, size=shape, dtype=dtype, endpoint=True)


def test_every_type_comes_back_as_it_was() -> None:
    for dtype in ("uint8", "int8", "uint16", "int16", "int32", "float32", "float64"):
        for channels in ((), (1,), (2,), (3,), (4,), (5,)):
            image = picture(5, 7, *channels, dtype=dtype)
            message = BRIDGE.cv2_to_imgmsg(image)
            assert (message.height, message.width, message.step) == (5, 7, image.nbytes // 5)
            back = BRIDGE.imgmsg_to_cv2(message)
            wanted = image if channels != (1,) else image[..., 0]
            assert (back.dtype, back.flags.writeable) == (image.dtype, True)
            np.testing.assert_array_equal(back, wanted)


def test_encodings_are_types_of_opencv() -> None:
    wanted = {
        "mono8": cv2.CV_8UC1, "bgr8": cv2.CV_8UC3, "rgba8": cv2.CV_8UC4, "mono16": cv2.CV_16UC1,
        "rgb16": cv2.CV_16UC3, "bayer_rggb8": cv2.CV_8UC1, "bayer_grbg16": cv2.CV_16UC1, "yuv422": cv2.CV_8UC2,
        "32FC1": cv2.CV_32FC1, "64FC4": cv2.CV_64FC4, "16SC2": cv2.CV_16SC2, "32SC3": cv2.CV_32SC3,
    }  # fmt: skip
    assert {name: BRIDGE.encoding_to_cvtype2(name) for name in wanted} == wanted
    assert BRIDGE.encoding_to_dtype_with_channels("32FC2") == ("float32", 2)
    assert BRIDGE.cvtype_to_name[cv2.CV_8UC3] == "8UC3"
    for name in ("", "rgb9", "bgr", "8UC0", "9UC1", "bayer_xxxx8", "8UC513"):
        with pytest.raises(CvBridgeError, match="Unrecognized image encoding"):
            BRIDGE.encoding_to_cvtype2(name)


def test_colours_are_what_opencv_makes_of_them() -> None:
    bgr, grey, bgra = picture(6, 8, 3), picture(6, 8), picture(6, 8, 4)
    cases = [
        (bgr, "bgr8", "rgb8", cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)),
        (bgr, "bgr8", "mono8", cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)),
        (bgr, "rgb8", "mono8", cv2.cvtColor(bgr, cv2.COLOR_RGB2GRAY)),
        (bgr, "rgb8", "bgra8", cv2.cvtColor(bgr, cv2.COLOR_RGB2BGRA)),
        (bgra, "bgra8", "rgb8", cv2.cvtColor(bgra, cv2.COLOR_BGRA2RGB)),
        (grey, "mono8", "bgr8", cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)),
        (grey, "bayer_rggb8", "bgr8", cv2.cvtColor(grey, cv2.COLOR_BayerBG2BGR)),
        (grey, "bayer_gbrg8", "rgb8", cv2.cvtColor(grey, cv2.COLOR_BayerGR2RGB)),
        (grey, "bayer_grbg8", "mono8", cv2.cvtColor(grey, cv2.COLOR_BayerGB2GRAY)),
        (picture(6, 8, 2), "yuv422", "bgr8", cv2.cvtColor(picture(6, 8, 2), cv2.COLOR_YUV2BGR_UYVY)),
        (picture(6, 8, 2), "yuv422_yuy2", "mono8", cv2.cvtColor(picture(6, 8, 2), cv2.COLOR_YUV2GRAY_YUY2)),
        (grey, "mono8", "mono16", grey.astype(np.uint16) * 257),
        (bgr, "bgr8", "8UC3", bgr),
        (bgr, "8UC3", "8UC3", bgr),
        (picture(6, 8, dtype="uint16"), "mono16", "32FC1", picture(6, 8, dtype="uint16").astype(np.float32)),
    ]
    for image, encoding, wanted, result in cases:
        found = BRIDGE.imgmsg_to_cv2(BRIDGE.cv2_to_imgmsg(image, encoding), wanted)
        np.testing.assert_array_equal(found, result, err_msg=f"{encoding} to {wanted}")
        assert found.dtype == result.dtype
        assert found.flags.writeable
    deep = picture(6, 8, 3, dtype="uint16")
    found = BRIDGE.imgmsg_to_cv2(BRIDGE.cv2_to_imgmsg(deep, "bgr16"), "rgb8")
    np.testing.assert_allclose(found, deep[..., ::-1] / 257.0, atol=0.51)
    floats = np.array([[-5.0, 0.4, 0.6, 300.0]])
    found = BRIDGE.imgmsg_to_cv2(BRIDGE.cv2_to_imgmsg(floats, "64FC1"), "8UC1")
    assert found.tolist() == [[0, 0, 1, 255]], "rounded and cut off, as OpenCV does"


def test_conversions_that_make_no_sense() -> None:
    colour, plain = BRIDGE.cv2_to_imgmsg(picture(4, 4, 3), "bgr8"), BRIDGE.cv2_to_imgmsg(picture(4, 4, 3))
    cases = {
        "is not a color format": lambda: BRIDGE.imgmsg_to_cv2(plain, "bgr8"),
        "they must have as many": lambda: BRIDGE.imgmsg_to_cv2(plain, "mono16"),
        "3 and 1 channels": lambda: BRIDGE.imgmsg_to_cv2(colour, "8UC1"),
        r"Unsupported conversion from \[bgr8\]": lambda: BRIDGE.imgmsg_to_cv2(colour, "bayer_rggb8"),
        "Unrecognized": lambda: BRIDGE.imgmsg_to_cv2(colour, "nonsense"),
        "incompatible type 8UC3": lambda: BRIDGE.cv2_to_imgmsg(picture(4, 4, 3), "bgra8"),
        "2 or 3 dimensions": lambda: BRIDGE.cv2_to_imgmsg(picture(4)),
        "no images of": lambda: BRIDGE.cv2_to_imgmsg(np.zeros((2, 2), np.int64)),
    }
    for text, act in cases.items():
        with pytest.raises(CvBridgeError, match=text):
            act()
    with pytest.raises(TypeError, match="not a numpy array"):
        BRIDGE.cv2_to_imgmsg([[1]])


def test_rows_may_be_padded_and_bytes_swapped() -> None:
    image = picture(3, 5, 3)
    message = BRIDGE.cv2_to_imgmsg(image, "bgr8", header=interface("std_msgs/msg/Header")(frame_id="camera"))
    assert message.header.frame_id == "camera"
    padded = np.concatenate([image.reshape(3, 15), np.zeros((3, 2), np.uint8)], axis=1)
    message.step, message.data = 17, array.array("B", padded.tobytes())
    np.testing.assert_array_equal(BRIDGE.imgmsg_to_cv2(message), image)
    message.step = 14
    with pytest.raises(CvBridgeError, match="rows of 14 bytes, and 5 pixels take 15"):
        BRIDGE.imgmsg_to_cv2(message)
    message.step = 19
    with pytest.raises(CvBridgeError, match="wrongly formed: 51 bytes for 3 rows"):
        BRIDGE.imgmsg_to_cv2(message)
    numbers = np.arange(12, dtype=">i4").reshape(3, 4)
    swapped = BRIDGE.cv2_to_imgmsg(numbers)
    assert swapped.is_bigendian
    found = BRIDGE.imgmsg_to_cv2(swapped)
    np.testing.assert_array_equal(found, numbers)
    assert found.dtype == np.int32
    assert BRIDGE.imgmsg_to_cv2(BRIDGE.cv2_to_imgmsg(np.empty((0, 4), np.uint8))).shape == (0, 4)


def test_compressed_images() -> None:
    for shape in ((8, 6), (8, 6, 3)):
        image = picture(*shape)
        for kind in ("png", "bmp"):
            message = BRIDGE.cv2_to_compressed_imgmsg(image, kind)
            assert message.format == kind
            np.testing.assert_array_equal(BRIDGE.compressed_imgmsg_to_cv2(message), image)
        assert BRIDGE.compressed_imgmsg_to_cv2(BRIDGE.cv2_to_compressed_imgmsg(image)).shape == shape
    png = BRIDGE.cv2_to_compressed_imgmsg(picture(8, 6, 3), "png")
    np.testing.assert_array_equal(BRIDGE.compressed_imgmsg_to_cv2(png, "rgb8"), picture(8, 6, 3)[..., ::-1])
    png.data = array.array("B", bytes(png.data)[:40])
    with pytest.raises(CvBridgeError, match="OpenCV cannot decode"):
        BRIDGE.compressed_imgmsg_to_cv2(png)
    with pytest.raises(CvBridgeError, match="OpenCV cannot make"):
        BRIDGE.cv2_to_compressed_imgmsg(picture(8, 6, 3), "nonsense")


def test_a_picture_that_would_fill_the_memory_is_not_decoded() -> None:
    head = b"\x89PNG\r\n\x1a\n" + b"\0\0\0\rIHDR" + (60_000).to_bytes(4, "big") * 2 + b"\x08\x02\0\0\0"
    message = interface("sensor_msgs/msg/CompressedImage")(format="png")
    message.data = array.array("B", head)
    with pytest.raises(CvBridgeError, match="60000 x 60000 pixels"):
        BRIDGE.compressed_imgmsg_to_cv2(message)


def test_without_opencv_what_needs_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from metaros.errors import ConfigError

    image = picture(6, 8, 3)
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    monkeypatch.setitem(sys.modules, "cv2", None)
    encodings._channel_shift.cache_clear()
    try:
        bridge = CvBridge()
        message = bridge.cv2_to_imgmsg(image, "bgr8")
        np.testing.assert_array_equal(bridge.imgmsg_to_cv2(message, "rgb8"), image[..., ::-1])
        np.testing.assert_allclose(bridge.imgmsg_to_cv2(message, "mono8").astype(int), grey, atol=1)
        for act in (
            lambda: bridge.imgmsg_to_cv2(bridge.cv2_to_imgmsg(grey, "bayer_rggb8"), "bgr8"),
            lambda: bridge.cv2_to_compressed_imgmsg(image),
            lambda: bridge.compressed_imgmsg_to_cv2(interface("sensor_msgs/msg/CompressedImage")()),
        ):
            with pytest.raises(ConfigError, match=r"metaros\[drivers\]"):
                act()
    finally:
        encodings._channel_shift.cache_clear()
