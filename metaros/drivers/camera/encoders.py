"""Pictures to bytes: JPEG by OpenCV, H.264 by PyAV (FFmpeg).

H.264 is made for a live view: no delay, no B-frames, parameter sets in front of each key frame, a key frame at least
every GROUP_S (ITU-T H.264, Annex B).
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any, Final

import numpy as np

from metaros.drivers.camera.ladder import Rung
from metaros.drivers.camera.source import Image
from metaros.errors import ConfigError, UnavailableError

__all__ = ["GROUP_S", "SOFTWARE", "H264Encoder", "encode_jpeg", "resized"]

GROUP_S: Final = 2.0
SOFTWARE: Final = "libx264"
_START: Final = b"\x00\x00\x00\x01"


def resized(image: Image, width: int, height: int) -> Image:
    """The picture in that size."""
    import cv2

    if image.shape[:2] == (height, width):
        return image
    small = image.shape[0] * image.shape[1] > width * height
    kind = cv2.INTER_AREA if small else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=kind), np.uint8)


def encode_jpeg(image: Image, quality: int) -> bytes:
    """The picture as JPEG; UnavailableError where OpenCV cannot."""
    import cv2

    good, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not good:
        raise UnavailableError("OpenCV could not encode the picture")
    return bytes(data)


class H264Encoder:
    """One stream of pictures of one size and bit rate; it begins with a key frame."""

    def __init__(self, rung: Rung, *, rate: float, name: str = SOFTWARE, warn: Callable[[str], object]) -> None:
        """Raises ConfigError: PyAV or an encoder is missing."""
        try:
            import av
        except ImportError:
            raise ConfigError("camera: H.264 needs PyAV: pip install 'metaros[video]'") from None
        self._av: Any = av
        self.rung = rung
        self._count = 0
        self._group = max(1, round(rate * GROUP_S))
        self._rate = Fraction(rate).limit_denominator(1000)
        try:
            self._context = self._open(name)
        except (av.FFmpegError, ValueError) as error:
            if name == SOFTWARE:
                raise ConfigError(f"camera: {SOFTWARE} cannot be opened: {error}") from None
            warn(f"the encoder {name} cannot be opened ({error}): {SOFTWARE} is used")
            self._context = self._open(SOFTWARE)

    @property
    def name(self) -> str:
        """FFmpeg's name of the encoder that is used."""
        return str(self._context.name)

    def encode(self, image: Image, *, key_frame: bool) -> bytes:
        """One access unit in Annex B; empty where the encoder holds it back. UnavailableError where it failed."""
        av = self._av
        frame = av.VideoFrame.from_ndarray(resized(image, self.rung.width, self.rung.height), format="bgr24")
        frame = frame.reformat(format=self._context.pix_fmt)
        frame.pts = self._count
        frame.pict_type = av.video.frame.PictureType.I if key_frame else av.video.frame.PictureType.NONE
        self._count += 1
        try:
            packets = self._context.encode(frame)
        except av.FFmpegError as error:
            raise UnavailableError(f"H.264 could not be encoded: {error}") from None
        return b"".join(self._with_sets(packet) for packet in packets)

    def _open(self, name: str) -> Any:
        context: Any = self._av.CodecContext.create(name, "w")
        context.width, context.height = self.rung.width, self.rung.height
        context.pix_fmt = "yuv420p"
        context.time_base, context.framerate = 1 / self._rate, self._rate
        context.bit_rate = self.rung.bitrate_bps
        context.gop_size, context.max_b_frames = self._group, 0
        context.thread_count = 1
        if name == SOFTWARE:
            kilobits = self.rung.bitrate_bps // 1000
            context.options = {
                "preset": "ultrafast",
                "tune": "zerolatency",
                "forced-idr": "1",
                "x264-params": f"keyint={self._group}:min-keyint=1:scenecut=0:bframes=0:repeat-headers=1:annexb=1"
                f":vbv-maxrate={kilobits}:vbv-bufsize={kilobits // 2}",
            }
        context.open()
        return context

    def _with_sets(self, packet: Any) -> bytes:
        """A key frame of a hardware encoder may come without its parameter sets."""
        data = bytes(packet)
        sets = bytes(self._context.extradata or b"")
        if (
            packet.is_keyframe
            and sets.startswith(_START)
            and sets not in data[: len(sets) + 64]
            and b"\x67" not in data[:8]
        ):
            return sets + data
        return data
