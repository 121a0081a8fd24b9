"""A microphone: packets of 20 ms from PortAudio, amplified, measured, and published as PCM, Opus or both."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from metaros.convert.audio import numpy_to_audio
from metaros.drivers.context import DriverContext
from metaros.drivers.microphone.level import LevelMeter
from metaros.drivers.opus import OpusEncoder
from metaros.drivers.sound import Pacer, SoundStream
from metaros.interfaces.foxglove_msgs.msg import RawAudio
from metaros.interfaces.metaros_msgs.msg import AudioPacket
from metaros.interfaces.std_msgs.msg import Float32

__all__ = ["make"]

MUTED: Final = "muted"


class Microphone:
    """One sound input."""

    def __init__(self, context: DriverContext) -> None:
        """ConfigError: Opus without PyAV."""
        self._context = context
        self._rate, self._channels = int(context["rate"]), int(context["channels"])
        self._stream: SoundStream | None = None
        output = context["output"]
        self._pcm = context.publisher(RawAudio, "audio") if output != "opus" else None
        self._opus = context.publisher(AudioPacket, "audio/opus", reading=output == "opus") if output != "pcm" else None
        self._level = context.publisher(Float32, "audio/level", reading=False)
        self._encoder = self._new_encoder()

    def open(self) -> None:
        """Reach the input."""
        self._stream = SoundStream(self._context, "input", rate=self._rate, channels=self._channels)
        self._encoder = self._new_encoder()
        self._context.opened(f"{self._stream.name} at {self._rate} Hz", hardware_id=self._stream.name)

    def run(self) -> None:
        """Publish packets until the driver stops."""
        context, stream, pacer, meter = self._context, self._stream, Pacer(self._context.clock), LevelMeter()
        assert stream is not None
        while not context.stopping:
            data, waiting, lost = stream.read()
            late_s = (stream.frames + waiting) / self._rate  # from the first sample's capture until now
            stamp_ns = context.clock.wall_ns() - round(late_s * 1e9)
            if lost:
                context.count("overflows")
            samples = np.frombuffer(context.heard(data), "<i2").reshape(-1, self._channels)
            self._take(amplified(samples, float(context["gain_db"])), stamp_ns, meter)
            if (ahead_s := pacer.ahead_s(blocked=stream.blocked)) > 0:
                context.wait(ahead_s)

    def close(self) -> None:
        """Let it go."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()

    def _take(self, samples: npt.NDArray[np.int16], stamp_ns: int, meter: LevelMeter) -> None:
        context = self._context
        muted = bool(context["mute"])
        if muted != (context.status.warning == MUTED):
            context.warn(MUTED if muted else "")
        if muted:
            return
        if (level_db := meter.add(samples)) is not None:
            context.fact("level_dbfs", f"{level_db:.1f}")
            self._level.publish(Float32(data=level_db))
        if self._pcm is not None:
            self._pcm.publish(numpy_to_audio(samples, self._rate, stamp_ns=stamp_ns))
        if self._opus is not None and self._encoder is not None:
            for data in self._encoder.encode(samples):
                self._opus.publish(
                    AudioPacket(
                        stamp=context.stamp(stamp_ns),
                        codec="opus",
                        sample_rate=self._rate,
                        channels=self._channels,
                        samples=samples.shape[0],
                        data=data,
                    )
                )

    def _new_encoder(self) -> OpusEncoder | None:
        if self._opus is None:
            return None
        return OpusEncoder(self._rate, self._channels, bitrate=int(self._context["bitrate"]))


def amplified(samples: npt.NDArray[np.int16], gain_db: float) -> npt.NDArray[np.int16]:
    """The samples, clipped at full scale; at 0 dB exactly what they were."""
    if gain_db == 0:
        return samples
    louder: npt.NDArray[np.int16] = np.clip(np.rint(samples * 10 ** (gain_db / 20)), -32768, 32767).astype(np.int16)
    return louder


def make(context: DriverContext) -> Microphone:
    """The kind's device."""
    return Microphone(context)
