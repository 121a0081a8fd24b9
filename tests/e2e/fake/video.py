"""A fake robot whose camera also sends H.264: a real encoder, and whatever can go wrong with its stream."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import av
import numpy as np
import numpy.typing as npt

from metaros.cdr import codec
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.foxglove_msgs.msg import CompressedVideo
from tests.e2e.fake.robots import TOPICS, FakeRobot, FakeTopic

__all__ = ["VIDEO", "VideoRobot"]

VIDEO = FakeTopic("camera/video", "foxglove_msgs/msg/CompressedVideo", "live", 30.0)
Picture = npt.NDArray[np.uint8]


class VideoRobot(FakeRobot):
    """Gives a key frame to each subscription that begins, and no other."""

    size: tuple[int, int] = (640, 360)  # width and height, in pixels
    pictures = True  # whether its camera sends JPEG as well
    format = "h264"
    joins = 0  # subscriptions of its video so far
    lose = 0  # so many frames get lost on their way
    spoil = 0  # so many frames' slices are random bytes
    only_deltas = False  # its store has frames which build on others that are not there

    @property
    def topics(self) -> tuple[FakeTopic, ...]:
        """Those of every fake robot, and its video."""
        kept = (topic for topic in TOPICS if self.pictures or topic.name != "camera/image/compressed")
        return (*kept, VIDEO)

    def describe_channel(self, number: int, topic: FakeTopic) -> dict[str, Any]:
        """A subscription begins: of the video, with a key frame."""
        if topic is VIDEO:
            self.joins += 1
            self._encoder = None
        return super().describe_channel(number, topic)

    _encoder: Any = None
    _count = 0

    def encode(self, topic: FakeTopic, at_s: float) -> bytes:
        """The next frame of the video, or none if it gets lost."""
        if topic is not VIDEO:
            return super().encode(topic, at_s)
        data = self._frame(at_s)
        if self.lose:
            self.lose -= 1
            return b""
        if self.spoil:
            self.spoil -= 1
            data = _spoiled()
        stamp = Time(sec=int(at_s), nanosec=int(at_s % 1 * 1e9))
        return codec(VIDEO.type).encode(
            CompressedVideo(timestamp=stamp, frame_id="camera", data=data, format=self.format)
        )

    def stored(self, topic: FakeTopic, at_s: float) -> bytes:
        """Of the video: a key frame, or one that builds on it."""
        if topic is VIDEO:
            self._encoder = None
            if self.only_deltas:
                self.encode(VIDEO, at_s)
        return self.encode(topic, at_s)

    def _frame(self, at_s: float) -> bytes:
        encoder = self._encoder
        if encoder is None or (encoder.width, encoder.height) != self.size:
            encoder = self._encoder = _new_encoder(*self.size)
        frame = av.VideoFrame.from_ndarray(_picture(*self.size, at_s), format="rgb24")
        frame.pts = self._count = self._count + 1
        return b"".join(bytes(packet) for packet in encoder.encode(frame))


def _new_encoder(width: int, height: int) -> Any:
    encoder: Any = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = width, height, "yuv420p"
    encoder.time_base, encoder.bit_rate = Fraction(1, 30), 1_000_000
    encoder.options = {"preset": "ultrafast", "tune": "zerolatency", "g": "100000"}
    return encoder


def _picture(width: int, height: int, at_s: float) -> Picture:
    """A slope of colours that moves, so that each frame differs."""
    across = (np.arange(width) + int(at_s * 120)) % 256
    down = np.linspace(0, 255, height).astype(int)
    picture = np.empty((height, width, 3), np.uint8)
    picture[..., 0], picture[..., 1], picture[..., 2] = across, down[:, None], 255 - across
    return picture


def _spoiled() -> bytes:
    """An access unit of the same kind whose slice no decoder can read."""
    return b"\0\0\0\1" + bytes([0x41]) + bytes(range(1, 255)) * 4
