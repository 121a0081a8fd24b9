"""Samples as lines of text: `ax,ay,az,gx,gy,gz` or `ax,ay,az,gx,gy,gz,mx,my,mz`. Pure.

Our own reading of what many small boards print; blanks, tabs and semicolons separate as commas do. Other lines
(headings, comments, half lines) are counted as `bad_lines` and skipped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Final

from metaros.drivers.imu.sample import GRAVITY_M_S2, Sample, Vector
from metaros.drivers.lines import LineSplitter

__all__ = ["UNITS", "CsvDecoder"]

MAX_LINE: Final = 256
UNITS: Final = {
    "m/s2": 1.0,
    "g": GRAVITY_M_S2,
    "mg": GRAVITY_M_S2 / 1000,
    "rad/s": 1.0,
    "deg/s": math.pi / 180,
    "T": 1.0,
    "uT": 1e-6,
    "mG": 1e-7,
}
_BLANKS: Final = str.maketrans(",;\t", "   ")


class CsvDecoder:
    """Feed bytes, get samples."""

    def __init__(self, count: Callable[[str], object], *, acceleration: str, rate: str, magnetic: str) -> None:
        """The units are names in UNITS."""
        self._count = count
        self._scales = (UNITS[acceleration], UNITS[rate], UNITS[magnetic])
        self._lines = LineSplitter(max_bytes=MAX_LINE, count=count)

    def feed(self, data: bytes) -> Iterator[Sample]:
        """Samples that these bytes complete."""
        for line in self._lines.feed(data):
            numbers = _numbers(line)
            if len(numbers) not in (6, 9):
                self._count("bad_lines")
                continue
            vectors = [
                _scaled(numbers[at : at + 3], scale)
                for at, scale in zip(range(0, len(numbers), 3), self._scales, strict=False)
            ]
            magnetic = vectors[2] if len(vectors) == 3 else None
            yield Sample(acceleration_m_s2=vectors[0], rate_rad_s=vectors[1], magnetic_t=magnetic)


def _numbers(line: str) -> list[float]:
    if "_" in line:  # which Python takes within numbers
        return []
    try:
        return [float(text) for text in line.translate(_BLANKS).split()]
    except ValueError:
        return []


def _scaled(numbers: list[float], scale: float) -> Vector:
    x, y, z = numbers
    return (x * scale, y * scale, z * scale)
