"""From one encoding to another by the rules of cv_bridge, which are OpenCV's where colours change."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.convert.encodings import encoding_of
from metaros.convert.image import recolour
from metaros.convert.opencv import opencv
from metaros.errors import ConfigError
from metaros.ros2.cv_bridge.encodings import Layout, layout_of

__all__ = ["NUMPY_NAMES", "converted"]

NUMPY_NAMES = {
    "8U": "uint8",
    "8S": "int8",
    "16U": "uint16",
    "16S": "int16",
    "32S": "int32",
    "32F": "float32",
    "64F": "float64",
}

Pixels = npt.NDArray[Any]


def converted(pixels: Pixels, source: str, wanted: str) -> Pixels:
    """An array of its own in the other encoding.

    Raises:
        ValueError: that makes no sense, or an encoding is unknown.
        ConfigError: it needs OpenCV, which is not installed.
    """
    have, want = _known(source), _known(wanted)
    if source == wanted:
        return pixels.copy()
    if not (have.colours and want.colours):
        if have.channels != want.channels:
            raise ValueError(
                f"[{source}] and [{wanted}] have {have.channels} and {want.channels} channels, and one of them says "
                "nothing of colours: they must have as many"
            )
        if want.colours and not have.colours:
            raise ValueError(f"[{source}] is not a color format, but [{wanted}] is: the conversion does not make sense")
        return _scaled(pixels, have, want)
    if have.colours != want.colours:
        if want.is_raw:
            raise ValueError(f"Unsupported conversion from [{source}] to [{wanted}]")
        pixels = _recoloured(pixels, source, have, want)
    return _scaled(pixels, have, want)


def _known(encoding: str) -> Layout:
    layout = layout_of(encoding)
    if layout is None:
        raise ValueError(f"Unrecognized image encoding [{encoding}]")
    return layout


def _recoloured(pixels: Pixels, source: str, have: Layout, want: Layout) -> Pixels:
    """Other colours, of the same depth."""
    if have.is_raw:
        name = f"YUV2{want.colours}_{have.colours}" if have.channels == 2 else f"{have.colours}2{want.colours}"
        try:
            code = getattr(opencv(), f"COLOR_{name}")
        except AttributeError:
            raise ValueError(f"Unsupported conversion from [{source}] to {want.colours}") from None
        return _by_opencv(pixels, code)
    try:
        return _by_opencv(pixels, getattr(opencv(), f"COLOR_{have.colours}2{want.colours}"))
    except ConfigError:  # the same by numpy; greys may differ by one, as OpenCV counts in whole numbers
        kind = encoding_of(source)
        if kind is None:
            raise
        names = {"GRAY": "mono"}.get(want.colours, want.colours.lower())
        return recolour(pixels, kind, f"{names}{have.bits}")


def _by_opencv(pixels: Pixels, code: int) -> Pixels:
    made: Pixels = opencv().cvtColor(np.ascontiguousarray(pixels), code)
    return made


def _scaled(pixels: Pixels, have: Layout, want: Layout) -> Pixels:
    """Another depth: of 8 and 16 bits the whole range becomes the whole range, else numbers stay and are cut off."""
    if have.depth == want.depth:
        return pixels.copy()
    dtype: Any = np.dtype(NUMPY_NAMES[want.depth])
    factor = {(8, 16): 65535.0 / 255.0, (16, 8): 255.0 / 65535.0}.get((have.bits, want.bits), 1.0)
    if dtype.kind == "f":
        return pixels.astype(dtype)
    info = np.iinfo(dtype)
    made: Pixels = np.clip(np.rint(pixels * factor if factor != 1.0 else pixels), info.min, info.max).astype(dtype)
    return made
