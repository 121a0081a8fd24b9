"""From messages to samples at the device's rate: one decoder and one resampler for each stream."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.drivers.opus import OpusDecoder, have_opus
from metaros.drivers.speaker.resampler import Resampler
from metaros.errors import DecodeError

__all__ = ["MAX_PCM_BYTES", "RATES", "PacketReader"]

RATES: Final = range(8000, 192_001)
MAX_CHANNELS: Final = 8
MAX_PCM_BYTES: Final = 256 * 1024  # of one message
MAX_PACKET_S: Final = 1


class PacketReader:
    """Reads the packets of one stream. Every field was written by somebody else: DecodeError for what is absurd."""

    def __init__(self, rate: int) -> None:
        self._rate = rate
        self._resampler: tuple[int, Resampler] | None = None
        self._decoder: tuple[int, OpusDecoder] | None = None

    def reset(self) -> None:
        """What comes next has nothing to do with what came."""
        self._resampler = self._decoder = None

    def read(self, coding: str, data: Any, *, rate: int, channels: int) -> npt.NDArray[np.float32]:
        """One packet's samples, mixed to one channel. DecodeError."""
        if not 1 <= channels <= MAX_CHANNELS:
            raise DecodeError(f"{channels} channels: 1 to {MAX_CHANNELS} are possible")
        if coding == "opus":
            if channels > 2:
                raise DecodeError(f"Opus with {channels} channels: 1 or 2 are possible")
            return self._converted(self._opus(channels).decode(bytes(data)), OpusDecoder.rate)
        if coding != "pcm-s16":
            raise DecodeError(f"the coding {coding[:20]!r} is neither pcm-s16 nor opus")
        if rate not in RATES:
            raise DecodeError(f"{rate} samples a second: {RATES.start} to {RATES.stop - 1} are possible")
        raw = bytes(data) if len(data) <= MAX_PCM_BYTES else b""
        if not raw or len(raw) % (2 * channels):
            raise DecodeError(f"{len(data)} bytes are no whole samples of {channels} channels, or too many")
        if len(raw) > 2 * channels * rate * MAX_PACKET_S:
            raise DecodeError(f"more than {MAX_PACKET_S} s of sound in one message")
        samples = np.frombuffer(raw, "<i2").reshape(-1, channels).astype(np.float32) / 32768.0
        return self._converted(samples.mean(axis=1, dtype=np.float32), rate)

    def _opus(self, channels: int) -> OpusDecoder:
        if not have_opus():
            raise DecodeError("Opus needs PyAV: pip install 'metaros[video]'")
        if self._decoder is None or self._decoder[0] != channels:
            self._decoder = (channels, OpusDecoder(channels))
        return self._decoder[1]

    def _converted(self, samples: npt.NDArray[np.float32], rate: int) -> npt.NDArray[np.float32]:
        if self._resampler is None or self._resampler[0] != rate:
            self._resampler = (rate, Resampler(rate, self._rate))
        return self._resampler[1].push(samples)
