"""The image encodings of ROS as a table: element type, channels, and where the colours are."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np

__all__ = ["Encoding", "encoding_of"]


@dataclass(frozen=True, slots=True)
class Encoding:
    """`colours` is the order of the channels, such as "bgr"; empty for what is no colour image."""

    name: str
    dtype: np.dtype[Any]
    channels: int
    colours: str = ""


_TYPES: Final = {"8U": "u1", "8S": "i1", "16U": "u2", "16S": "i2", "32S": "i4", "32F": "f4", "64F": "f8"}
_OPENCV: Final = re.compile(r"(8U|8S|16U|16S|32S|32F|64F)C([1-9][0-9]?|)\Z")
_COLOUR: Final = re.compile(r"(mono|rgb|bgr|rgba|bgra)(8|16)\Z")
_BAYER: Final = re.compile(r"bayer_(rggb|bggr|gbrg|grbg)(8|16)\Z")
_YUV: Final = ("yuv422", "uyvy", "yuv422_yuy2", "yuyv")
_ORDERS: Final = {"mono": "g", "rgb": "rgb", "bgr": "bgr", "rgba": "rgba", "bgra": "bgra"}
_MAX_CHANNELS: Final = 32


@lru_cache(maxsize=64)
def encoding_of(name: str) -> Encoding | None:
    """The encoding of that name, or None if it is none that is a plain array of pixels."""
    if match := _COLOUR.match(name):
        order = _ORDERS[match[1]]
        return Encoding(name, np.dtype(f"u{int(match[2]) // 8}"), len(order), order)
    if match := _BAYER.match(name):
        return Encoding(name, np.dtype(f"u{int(match[2]) // 8}"), 1)
    if match := _OPENCV.match(name):
        channels = int(match[2] or 1)
        return Encoding(name, np.dtype(_TYPES[match[1]]), channels) if channels <= _MAX_CHANNELS else None
    if name in _YUV:
        return Encoding(name, np.dtype("u1"), 2)
    return None
