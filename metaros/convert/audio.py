"""numpy ↔ foxglove_msgs/RawAudio, in the one format that viewers play: 16-bit PCM, channels interleaved."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.convert.stamps import stamp
from metaros.errors import DecodeError, FieldError
from metaros.idl.arrays import as_array
from metaros.interfaces.foxglove_msgs.msg import RawAudio

__all__ = ["audio_to_numpy", "numpy_to_audio"]

_FORMAT: Final = "pcm-s16"
_SCALE: Final = 32768.0
_WIRE: Final = np.dtype("<i2")
_MAX_CHANNELS: Final = 64


def numpy_to_audio(samples: npt.NDArray[Any], sample_rate: int, *, stamp_ns: int = 0) -> RawAudio:
    """Samples as (n,) or (n, channels): int16, or floats from -1 to 1, of which what is beyond is cut off."""
    if samples.ndim not in (1, 2):
        raise FieldError(f"audio is (samples,) or (samples, channels), not of {samples.ndim} dimensions")
    channels = samples.shape[1] if samples.ndim == 2 else 1
    if not 1 <= channels <= _MAX_CHANNELS:
        raise FieldError(f"{channels} channels: 1 to {_MAX_CHANNELS} are possible; the shape is (samples, channels)")
    if not 0 < sample_rate < 2**32:
        raise FieldError(f"sample_rate: {sample_rate} is no number of samples a second")
    if samples.dtype.kind == "f":
        if np.isnan(samples).any():
            raise FieldError("a sample is NaN")
        samples = np.clip(np.rint(samples * _SCALE), -_SCALE, _SCALE - 1)
    elif samples.dtype.newbyteorder("=") != np.int16:
        raise FieldError(f"samples are int16 or floats, not {samples.dtype.name}")
    data = np.ascontiguousarray(samples, _WIRE).reshape(-1).view(np.uint8)
    return RawAudio(
        timestamp=stamp(stamp_ns), data=data, format=_FORMAT, sample_rate=sample_rate, number_of_channels=channels
    )


def audio_to_numpy(message: Any, dtype: npt.DTypeLike = np.int16) -> npt.NDArray[Any]:
    """The samples as (n, channels): int16, or as floats from -1 to 1 if `dtype` is float32 or float64."""
    wanted: Any = np.dtype(dtype)
    if wanted.name not in ("int16", "float32", "float64"):
        raise FieldError(f"samples are int16, float32 or float64, not {wanted.name}")
    if message.format != _FORMAT:
        raise DecodeError(f"the audio format {str(message.format)[:40]!r} is not {_FORMAT}")
    channels, data = message.number_of_channels, as_array(message.data, "uint8")
    if not 1 <= channels <= _MAX_CHANNELS or data.size % (2 * channels):
        raise DecodeError(f"{data.size} bytes are no whole samples of {channels} channels")
    if not data.flags.c_contiguous:
        data = np.ascontiguousarray(data)
    samples = data.reshape(-1).view(_WIRE).reshape(-1, channels)
    if wanted == np.int16:
        return samples.astype(np.int16, copy=False)
    scaled: npt.NDArray[Any] = samples.astype(wanted) / wanted.type(_SCALE)
    return scaled
