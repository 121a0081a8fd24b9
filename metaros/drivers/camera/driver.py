"""The camera: one thread reads, the driver's own encodes and publishes; what viewers ask for is obeyed."""

from __future__ import annotations

from typing import Any

from metaros.drivers.camera.calibration import Rectifier, read_calibration
from metaros.drivers.camera.encoders import H264Encoder, encode_jpeg, resized
from metaros.drivers.camera.grabber import Grabber, Picture
from metaros.drivers.camera.ladder import HEARD_FOR_S, KeyFrames, Ladder
from metaros.drivers.camera.source import MAX_PIXELS, Image, open_source, redacted, resolve_source
from metaros.drivers.context import DriverContext
from metaros.errors import ConfigError, NameError_
from metaros.idl import names
from metaros.interfaces.foxglove_msgs.msg import CompressedVideo
from metaros.interfaces.metaros_msgs.msg import VideoDemand
from metaros.interfaces.sensor_msgs.msg import CameraInfo, CompressedImage
from metaros.interfaces.std_msgs.msg import Header

__all__ = ["CameraDevice", "make"]

_TAKE_S = 0.1


def make(context: DriverContext) -> CameraDevice:
    """The camera of the parameters. Raises ConfigError."""
    return CameraDevice(context)


class CameraDevice:
    """A source and what is made of its pictures."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._name = resolve_source(context["source"])
        self._size = width, height = context["width"], context["height"]
        if width * height > MAX_PIXELS:
            raise ConfigError(f"camera: width x height is {width * height}, at most {MAX_PIXELS}")
        self._calibration = (
            read_calibration(context["calibration"]).scaled(width, height) if context["calibration"] else None
        )
        if context["rectify"] and self._calibration is None:
            raise ConfigError("camera: rectify needs a calibration")
        self._rectify = Rectifier(self._calibration) if context["rectify"] and self._calibration is not None else None
        self._grabber: Grabber | None = None
        self._open_topics(_topic(context["topic"]))
        context.on_change("exposure", self._expose)
        if "@" in context["source"] and "://" in context["source"]:
            context.log.warn("camera: every node can read the password in `source`: give it by env:NAME")

    def _open_topics(self, topic: str) -> None:
        context, output = self._context, self._context["output"]
        self._images = context.publisher(CompressedImage, f"{topic}/image/compressed") if output != "h264" else None
        self._infos = (
            context.publisher(CameraInfo, f"{topic}/camera_info", reading=False) if self._calibration else None
        )
        self._video: Video | None = None
        if output != "jpeg":
            self._video = Video(context, f"{topic}/video")

    def open(self) -> None:
        """Open the source and begin to read."""
        context = self._context
        width, height = self._size
        source = open_source(self._name, width=width, height=height, rate=context["rate"])
        self._grabber = Grabber(
            source, rate=context["rate"], clock=context.clock, dropped=lambda: context.count("pictures_dropped")
        )
        if context["exposure"]:
            self._grabber.exposure = context["exposure"]
        if self._video is not None:
            self._video.begin()

    def run(self) -> None:
        """Publish what is read."""
        grabber, context = self._grabber, self._context
        assert grabber is not None
        opened = False
        while not context.stopping:
            picture = grabber.take(_TAKE_S)
            if picture is None:
                continue
            if not opened:
                opened = True
                height, width = picture.image.shape[:2]
                context.opened(f"{redacted(self._name)}, {width} x {height}", hardware_id=redacted(self._name))
            self._publish(picture)

    def close(self) -> None:
        """Let the source go."""
        grabber, self._grabber = self._grabber, None
        if grabber is not None:
            grabber.close()

    def _publish(self, picture: Picture) -> None:
        image = resized(picture.image, *self._size)
        if self._rectify is not None:
            image = self._rectify(image)
        context = self._context
        header = Header(stamp=context.stamp(picture.stamp_ns), frame_id=context["frame_id"])
        if self._infos is not None and self._calibration is not None:
            self._infos.publish(self._calibration.info(header, rectified=self._rectify is not None))
        if self._images is not None:
            data = context.faults.garbled(encode_jpeg(image, context["quality"]))
            self._images.publish(CompressedImage(header=header, format="jpeg", data=data))
            context.count("bytes_jpeg", len(data))
        if self._video is not None:
            self._video.publish(image, header)

    def _expose(self, value: float) -> None:
        if self._grabber is not None:
            self._grabber.exposure = value


class Video:
    """The H.264 side: an encoder on the rung that the link carries, key frames where somebody needs one."""

    def __init__(self, context: DriverContext, topic: str) -> None:
        self._context = context
        self._publisher = context.publisher(CompressedVideo, topic)
        self._keys = KeyFrames()
        self._ladder = Ladder(context["width"], context["height"], context["bitrate"])
        self._encoder: H264Encoder | None = None
        self._viewers = 0
        self._bitrate_bps = 0
        self._feedback_s = float("-inf")
        H264Encoder(
            self._ladder.rung, rate=context["rate"], name=context["encoder"], warn=context.log.warn
        )  # can it be done?
        context.subscription(VideoDemand, f"{topic}/demand", self._on_demand)

    def begin(self) -> None:
        """Pictures come anew: the first is a key frame."""
        self._encoder = None

    def publish(self, image: Image, header: Header) -> None:
        """Encode and send one picture, unless nobody wants any."""
        context, now_s = self._context, self._context.clock.monotonic_s()
        has_feedback = now_s - self._feedback_s < HEARD_FOR_S
        if context["on_demand"] and not (has_feedback and self._viewers):
            self._encoder = None
            return
        encoder = self._encoder_for(self._bitrate_bps if has_feedback else 0, now_s)
        data = context.faults.garbled(encoder.encode(image, key_frame=self._keys.due(now_s)))
        if data:
            message = CompressedVideo(timestamp=header.stamp, frame_id=header.frame_id, data=data, format="h264")
            self._publisher.publish(message)
            context.count("bytes_h264", len(data))

    def _encoder_for(self, bitrate_bps: int, now_s: float) -> H264Encoder:
        context, rung = self._context, self._ladder.carry(bitrate_bps, now_s)
        if self._encoder is None or self._encoder.rung != rung:
            self._encoder = H264Encoder(rung, rate=context["rate"], name=context["encoder"], warn=context.warn)
            context.fact("video", f"{self._encoder.name} {rung.width}x{rung.height} {rung.bitrate_bps // 1000} kbit/s")
        return self._encoder

    def _on_demand(self, demand: Any) -> None:
        self._feedback_s = self._context.clock.monotonic_s()
        self._viewers = demand.viewers
        self._bitrate_bps = demand.bitrate_bps
        if demand.key_frame:
            self._context.count("key_frames_asked")
            self._keys.ask()


def _topic(text: str) -> str:
    try:
        return names.validate_topic(text)
    except NameError_ as error:
        raise ConfigError(f"camera: topic: {error}") from None
