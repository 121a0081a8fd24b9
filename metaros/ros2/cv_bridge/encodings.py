"""What the encodings of images are to OpenCV: so many channels of a type, in an order of colours."""

from __future__ import annotations

import re
from functools import cache
from typing import Final, NamedTuple

from metaros.convert.opencv import opencv
from metaros.errors import ConfigError

__all__ = ["DEPTHS", "Layout", "cv_type", "layout_of", "of_cv_type"]

DEPTHS: Final = ("8U", "8S", "16U", "16S", "32S", "32F", "64F")  # in the order of OpenCV's numbers
_MOST_CHANNELS: Final = 512

_GENERIC: Final = re.compile(r"(8U|8S|16U|16S|32S|32F|64F)C([1-9][0-9]{0,2})")
_COLOURS: Final = {"mono": ("GRAY", 1), "rgb": ("RGB", 3), "bgr": ("BGR", 3), "rgba": ("RGBA", 4), "bgra": ("BGRA", 4)}
_YUV: Final = {"yuv422": "UYVY", "uyvy": "UYVY", "yuv422_yuy2": "YUY2", "yuyv": "YUY2"}
# OpenCV names a Bayer pattern by its second row's second and third pixel.
_BAYER: Final = {"rggb": "BayerBG", "bggr": "BayerRG", "gbrg": "BayerGR", "grbg": "BayerGB"}


class Layout(NamedTuple):
    """`depth` as OpenCV writes it, "8U"; `colours` a word of its conversion codes, nothing for a generic encoding."""

    depth: str
    channels: int
    colours: str = ""

    @property
    def bits(self) -> int:
        """Of one channel."""
        return int(self.depth[:-1])

    @property
    def is_raw(self) -> bool:
        """Whether pixels have to be made of neighbours first: Bayer patterns and YUV 4:2:2."""
        return self.colours.startswith("Bayer") or self.colours in ("UYVY", "YUY2")


def layout_of(encoding: str) -> Layout | None:
    """The layout of an encoding by its name in sensor_msgs, or None for one that is unknown."""
    if found := _GENERIC.fullmatch(encoding):
        channels = int(found[2])
        return Layout(found[1], channels) if channels <= _MOST_CHANNELS else None
    if encoding in _YUV:
        return Layout("8U", 2, _YUV[encoding])
    name, bits = (encoding[:-2], "16U") if encoding.endswith("16") else (encoding.removesuffix("8"), "8U")
    if encoding[len(name) :] not in ("8", "16"):
        return None
    if name in _COLOURS:
        colours, channels = _COLOURS[name]
        return Layout(bits, channels, colours)
    pattern = _BAYER.get(name.removeprefix("bayer_")) if name.startswith("bayer_") else None
    return None if pattern is None else Layout(bits, 1, pattern)


def cv_type(depth: str, channels: int) -> int:
    """The number of a type in the OpenCV that is installed: CV_8UC3 is 16 up to OpenCV 4, and 64 in OpenCV 5."""
    return DEPTHS.index(depth) + ((channels - 1) << _channel_shift())


def of_cv_type(number: int) -> tuple[str, int]:
    """The reverse. ValueError for a depth that images of ROS do not have."""
    shift = _channel_shift()
    depth = number & ((1 << shift) - 1)
    if not 0 <= depth < len(DEPTHS):
        raise ValueError(f"{number} is no type of OpenCV that an image of ROS can have")
    return DEPTHS[depth], (number >> shift) + 1


@cache
def _channel_shift() -> int:
    try:
        return int(opencv().CV_8UC2).bit_length() - 1
    except ConfigError:
        return 3
