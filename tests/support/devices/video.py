"""Real H.264 for tests: small frames by PyAV's encoder as messages, and the pictures that a decoder makes of them."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from functools import cache

import av
import numpy as np

from metaros.cdr import codec
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.foxglove_msgs.msg import CompressedVideo

__all__ = ["COMPRESSED_VIDEO", "access_units", "key_numbers", "pictures", "video_message"]

COMPRESSED_VIDEO = "foxglove_msgs/msg/CompressedVideo"
WIDTH, HEIGHT = 64, 48


@cache
def access_units(count: int, *, group: int = 5, bit_rate: int = 200_000) -> tuple[bytes, ...]:
    """So many pictures in Annex B, each group begun by parameter sets and an IDR; no two pictures are the same."""
    encoder = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = WIDTH, HEIGHT, "yuv420p"
    encoder.time_base, encoder.bit_rate = Fraction(1, 30), bit_rate
    encoder.options = {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "x264-params": f"keyint={group}:min-keyint={group}:scenecut=0:bframes=0:repeat-headers=1:annexb=1",
    }
    units = []
    for number in range(count):
        picture = np.full((HEIGHT, WIDTH, 3), 40, np.uint8)
        picture[:, : 1 + number % WIDTH] = 90 + number * 7 % 160  # grows, in another shade
        frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format="yuv420p")
        frame.pts = number
        units += [bytes(packet) for packet in encoder.encode(frame)]
    units += [bytes(packet) for packet in encoder.encode(None)]
    assert len(units) == count
    return tuple(units)


def video_message(unit: bytes, *, frame_id: str = "camera", stamp_ns: int = 0, kind: str = "h264") -> bytes:
    """An access unit as CDR of CompressedVideo."""
    stamp = Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    message = CompressedVideo(timestamp=stamp, frame_id=frame_id, data=np.frombuffer(unit, np.uint8), format=kind)
    return codec(COMPRESSED_VIDEO).encode(message)


def key_numbers(units: Iterable[bytes]) -> list[int]:
    """Which of them PyAV says are key frames."""
    found = []
    for number, unit in enumerate(units):
        types = {unit[at + 3] & 0x1F for at in range(len(unit) - 3) if unit[at : at + 3] == b"\x00\x00\x01"}
        if 5 in types:
            found.append(number)
    return found


def pictures(messages: Iterable[bytes]) -> list[bytes]:
    """The pictures that a decoder makes of CDR messages, each as its bytes.

    FFmpeg conceals a missing reference, so only the pictures tell: where something was left out, they are others.
    av.FFmpegError where nothing can be decoded at all.
    """
    decoder = av.CodecContext.create("h264", "r")
    decoder.thread_count = 1
    found = []
    for payload in messages:
        message = codec(COMPRESSED_VIDEO).decode(payload)
        found += decoder.decode(av.Packet(bytes(message.data)))
    found += decoder.decode(None)
    return [frame.to_ndarray(format="gray").tobytes() for frame in found]
