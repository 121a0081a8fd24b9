"""Opus (RFC 6716) by PyAV, which comes with the extra `video`: packets of 20 ms, one stream each."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.errors import ConfigError, DecodeError

__all__ = ["OPUS_RATES", "OpusDecoder", "OpusEncoder", "have_opus"]

OPUS_RATES: Final = (8000, 12000, 16000, 24000, 48000)
DECODED_RATE: Final = 48000
MAX_PACKET_BYTES: Final = 4096


def have_opus() -> bool:
    """Whether PyAV is installed."""
    return find_spec("av") is not None


class OpusEncoder:
    """Samples in, packets out; an encoder looks ahead, so that the first packet begins with 6.5 ms of silence."""

    def __init__(self, rate: int, channels: int, *, bitrate: int) -> None:
        """ConfigError: PyAV is not installed, or the rate is none of OPUS_RATES."""
        if not have_opus():
            raise ConfigError("Opus needs PyAV: pip install 'metaros[video]'")
        if rate not in OPUS_RATES:
            raise ConfigError(f"Opus has the rates {', '.join(map(str, OPUS_RATES))}, not {rate}")
        import av

        self._rate, self._layout = rate, "mono" if channels == 1 else "stereo"
        context: Any = av.CodecContext.create("libopus", "w")
        context.sample_rate, context.layout, context.format = rate, self._layout, "s16"
        context.bit_rate = bitrate
        context.options = {"application": "voip", "frame_duration": "20"}
        self._context, self._pts = context, 0

    def encode(self, samples: npt.NDArray[np.int16]) -> list[bytes]:
        """20 ms as (frames, channels)."""
        import av

        frame: Any = av.AudioFrame.from_ndarray(
            np.ascontiguousarray(samples).reshape(1, -1), format="s16", layout=self._layout
        )
        frame.sample_rate, frame.pts = self._rate, self._pts
        self._pts += samples.shape[0]
        return [bytes(packet) for packet in self._context.encode(frame)]


class OpusDecoder:
    """Packets in, samples at DECODED_RATE out, mixed to one channel."""

    rate: Final = DECODED_RATE

    def __init__(self, channels: int) -> None:
        import av

        self._context: Any = av.CodecContext.create("libopus", "r")
        self._context.sample_rate = DECODED_RATE
        self._context.layout = "mono" if channels == 1 else "stereo"

    def decode(self, data: bytes) -> npt.NDArray[np.float32]:
        """One packet, as floats from -1 to 1. DecodeError: it is none."""
        import av

        if not 0 < len(data) <= MAX_PACKET_BYTES:
            raise DecodeError(f"an Opus packet has 1 to {MAX_PACKET_BYTES} bytes, not {len(data)}")
        try:
            frames = self._context.decode(av.Packet(data))
        except (av.FFmpegError, ValueError) as error:
            raise DecodeError(f"no Opus packet: {error}") from None
        parts = [_mono(frame) for frame in frames]
        return np.concatenate(parts) if parts else np.zeros(0, np.float32)


def _mono(frame: Any) -> npt.NDArray[np.float32]:
    """A frame of PyAV, packed or planar, 16-bit or float."""
    samples = frame.to_ndarray()
    channels = len(frame.layout.channels)
    samples = samples.reshape(-1, channels) if frame.format.is_packed else samples.T
    scaled = samples.astype(np.float32) / (32768.0 if samples.dtype.kind == "i" else 1.0)
    mixed: npt.NDArray[np.float32] = scaled.mean(axis=1, dtype=np.float32)
    return mixed
