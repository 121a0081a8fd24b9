"""A stream of samples at another rate: band-limited interpolation with a windowed sinc (J. O. Smith, "Digital Audio
Resampling"), in pieces of any length without a seam. Pure.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = ["Resampler"]

ZEROS: Final = 12  # zero crossings of the sinc on each side
PIECE: Final = 4096  # outputs that are made at once, each of which takes some hundred bytes
PASS: Final = 0.95  # of the lower half rate is let through


class Resampler:
    """One stream of one channel."""

    def __init__(self, rate_in: int, rate_out: int) -> None:
        self._step = rate_in / rate_out
        self._same = rate_in == rate_out
        self._cutoff = PASS * min(1.0, rate_out / rate_in)
        self._half = math.ceil(ZEROS / self._cutoff)
        self._taps = np.arange(1 - self._half, self._half + 1)
        self._kept = np.zeros(self._half, np.float32)
        self._at = float(self._half)  # of the next output, in what is kept

    def push(self, samples: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """What can be said of the output by now."""
        if self._same:
            return samples
        kept = np.concatenate((self._kept, samples))
        count = max(0, math.ceil((len(kept) - self._half - self._at) / self._step))
        parts = [self._made(kept, first, min(PIECE, count - first)) for first in range(0, count, PIECE)]
        made = np.concatenate(parts) if parts else np.zeros(0, np.float32)
        self._at += count * self._step
        drop = min(int(self._at) - self._half, len(kept) - self._half)
        self._kept = kept[drop:]
        self._at -= drop
        return made

    def _made(self, kept: npt.NDArray[np.float32], first: int, count: int) -> npt.NDArray[np.float32]:
        places = self._at + np.arange(first, first + count) * self._step
        whole = places.astype(np.int64)
        away = (places - whole)[:, None] - self._taps
        weights = (
            self._cutoff * np.sinc(self._cutoff * away) * np.cos(np.clip(away / self._half, -1, 1) * (np.pi / 2)) ** 2
        )
        made: npt.NDArray[np.float32] = np.einsum("ij,ij->i", kept[whole[:, None] + self._taps], weights).astype(
            np.float32
        )
        return made
