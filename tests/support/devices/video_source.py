"""A camera of a robot, small but real: H.264 by PyAV as a node of its own, which does what viewers ask of it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

import av
import numpy as np

from metaros.executor import SingleThreadedExecutor
from metaros.idl import type_hash
from metaros.interfaces.metaros_msgs.msg import VideoDemand
from metaros.node import Context, Node
from metaros.wire import qos_sensor_data
from tests.support.devices.video import COMPRESSED_VIDEO, video_message

__all__ = ["VideoSource", "video_source"]

WIDTH, HEIGHT = 64, 48
RATE_HZ = 30.0
FILLER = b"\x00\x00\x00\x01\x0c"  # a NAL unit that decoders pass over


class VideoSource:
    """Pictures with an IDR at the start and when one is asked for, never else; each message has about `size_bytes`.

    With `obedient` messages are as small as the bit rate that is asked for.
    """

    def __init__(self, publisher: Any, *, size_bytes: int, obedient: bool) -> None:
        self.demands: list[tuple[bool, int, int]] = []  # key_frame, viewers, bitrate_bps
        self.keys: list[int] = []  # numbers of key frames
        self.shown: dict[
            int, bytes
        ] = {}  # by number, which is the message's stamp in ns: the picture that a viewer is to see
        self._publisher = publisher
        self._size_bytes = size_bytes
        self._obedient = obedient
        self._bitrate_bps = 0
        self._key = threading.Event()
        self._over = threading.Event()
        self._decoder = av.CodecContext.create("h264", "r")
        self._decoder.thread_count = 1
        self._decoder.flags |= av.codec.context.Flags.low_delay
        self._thread = threading.Thread(target=self._run, name="video-source")
        self._thread.start()

    def asked(self, demand: VideoDemand) -> None:
        """Somebody says what viewers need."""
        self.demands.append((demand.key_frame, demand.viewers, demand.bitrate_bps))
        self._bitrate_bps = demand.bitrate_bps
        if demand.key_frame:
            self._key.set()

    def close(self) -> None:
        """Take no more pictures."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        encoder = self._encoder()
        number = 0
        while not self._over.wait(1 / RATE_HZ):
            picture = np.full((HEIGHT, WIDTH, 3), 40, np.uint8)
            picture[:, : 1 + number % WIDTH] = 90 + number * 7 % 160
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format="yuv420p")
            frame.pts = number
            if self._key.is_set() or number == 0:
                self._key.clear()
                frame.pict_type = av.video.frame.PictureType.I
                self.keys.append(number)
            for packet in encoder.encode(frame):
                self._publish(bytes(packet), number)
            number += 1

    def _publish(self, unit: bytes, number: int) -> None:
        (frame,) = self._decoder.decode(av.Packet(unit)) or self._decoder.decode(None)
        self.shown[number] = frame.to_ndarray(format="gray").tobytes()
        size = self._size_bytes
        if self._obedient and self._bitrate_bps:
            size = min(size, int(self._bitrate_bps / 8 / RATE_HZ))
        filled = unit + FILLER + b"\xff" * max(0, size - len(unit)) + b"\x80"
        self._publisher.publish(video_message(filled, stamp_ns=number))

    @staticmethod
    def _encoder() -> Any:
        encoder = av.CodecContext.create("libx264", "w")
        encoder.width, encoder.height, encoder.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        encoder.time_base = Fraction(1, int(RATE_HZ))
        encoder.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "x264-params": "keyint=100000:scenecut=0:bframes=0:repeat-headers=1:annexb=1",
        }
        return encoder


@contextmanager
def video_source(zenoh: str, topic: str, *, size_bytes: int = 20_000, obedient: bool = False) -> Iterator[VideoSource]:
    """A node that sends video on a topic, on the router at that address."""
    with Context(connect=[zenoh]) as context, Node("camera", context=context) as node:
        publisher = node.create_raw_publisher(topic, COMPRESSED_VIDEO, type_hash(COMPRESSED_VIDEO), qos_sensor_data)
        source = VideoSource(publisher, size_bytes=size_bytes, obedient=obedient)
        executor = SingleThreadedExecutor()
        node.create_subscription(VideoDemand, f"{topic}/demand", source.asked)
        executor.add_node(node)
        spinning = threading.Thread(target=executor.spin, name="video source executor")
        spinning.start()
        try:
            yield source
        finally:
            source.close()
            executor.shutdown()
            spinning.join()
