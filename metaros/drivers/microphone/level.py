"""How loud sound is: RMS in dB of full scale (AES17 has a full-scale sine at 0; here a full-scale square is). Pure."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = ["SILENCE_DB", "LevelMeter"]

SILENCE_DB: Final = -100.0
PACKETS: Final = 10  # five times a second


class LevelMeter:
    """The level of each ten packets."""

    def __init__(self) -> None:
        self._sum = 0.0
        self._samples = self._packets = 0

    def add(self, samples: npt.NDArray[np.int16]) -> float | None:
        """Count a packet in; the level in dB where it was the tenth."""
        scaled = samples.astype(np.float64) / 32768.0
        self._sum += float(np.square(scaled).sum())
        self._samples += samples.size
        self._packets += 1
        if self._packets < PACKETS or not self._samples:
            return None
        mean = self._sum / self._samples
        self._sum, self._samples, self._packets = 0.0, 0, 0
        return max(SILENCE_DB, 10 * math.log10(mean)) if mean > 0 else SILENCE_DB
