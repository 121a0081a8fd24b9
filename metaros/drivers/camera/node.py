"""The camera node: a thread captures, encodes and publishes; a source that fails is opened again with back-off."""

from __future__ import annotations

import importlib.util
import threading
from collections.abc import Callable, Mapping
from typing import Any

from metaros.clock import Clock
from metaros.drivers.camera.parameters import CameraParameters, read_parameters
from metaros.drivers.camera.source import Image, Source, open_source
from metaros.errors import ClosedError, ConfigError, UnavailableError
from metaros.idl import message_class
from metaros.node import Context, Node
from metaros.wire import qos_sensor_data

__all__ = ["CameraNode", "encode_jpeg", "run"]

FIRST_RETRY_S, LAST_RETRY_S = 0.5, 10.0
_LOOK_S = 0.2
CLOSE_S = 2.8  # longer than a stream's read timeout, shorter than a supervisor's patience


class CameraNode:
    """A node with one publisher and one capturing thread; `close` stops both."""

    def __init__(
        self,
        context: Context,
        parameters: CameraParameters,
        *,
        namespace: str = "/",
        open_: Callable[[CameraParameters], Source] = open_source,
    ) -> None:
        self._parameters = parameters
        self._open = open_
        self._clock: Clock = context.clock
        self.node = Node("camera", namespace=namespace, context=context)
        self._image_type = message_class("sensor_msgs/msg/CompressedImage")
        self._publisher = self.node.create_publisher(self._image_type, parameters.topic, qos_sensor_data)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self.published = 0
        self._thread.start()

    def close(self) -> None:
        """Stop capturing, then undeclare the node."""
        self._stop.set()
        self._thread.join(CLOSE_S)
        self.node.close()

    @property
    def ended(self) -> bool:
        """Whether the capture ended by itself: its context was closed."""
        return not self._thread.is_alive()

    def _run(self) -> None:
        log = self.node.get_logger()
        retry_s = FIRST_RETRY_S
        while not self._stop.is_set():
            before = self.published
            try:
                source = self._open(self._parameters)
                try:
                    log.info(f"camera source {self._parameters.source} is open")
                    self._capture(source)
                finally:
                    source.close()
            except UnavailableError as error:
                retry_s = FIRST_RETRY_S if self.published > before else min(2 * retry_s, LAST_RETRY_S)
                log.warn(f"{error}; next try in {retry_s:g} s")
                self._stop.wait(retry_s)
            except ClosedError:
                return

    def _capture(self, source: Source) -> None:
        period_s = 1.0 / self._parameters.rate
        due_s = self._clock.monotonic_s()
        while not self._stop.is_set():
            image = source.read()
            now_s = self._clock.monotonic_s()
            if now_s + period_s / 4 < due_s and not self._paced():
                continue  # a camera faster than asked: read on, so that its buffer holds nothing old
            if now_s < due_s and self._stop.wait(due_s - now_s):
                return
            due_s = max(due_s + period_s, now_s)
            self._publish(image)

    def _paced(self) -> bool:
        """Whether the source gives images as fast as they are read, so that the rate is kept by waiting."""
        source = self._parameters.source
        return source == "test" or not (source.isdigit() or "://" in source)

    def _publish(self, image: Image) -> None:
        seconds, nanoseconds = divmod(self._clock.wall_ns(), 1_000_000_000)
        message: Any = self._image_type(format="jpeg", data=encode_jpeg(image, self._parameters))
        message.header.stamp.sec, message.header.stamp.nanosec = seconds, nanoseconds
        message.header.frame_id = self._parameters.frame_id
        self._publisher.publish(message)
        self.published += 1


def encode_jpeg(image: Image, parameters: CameraParameters) -> bytes:
    """The image, scaled to the parameters' size, as JPEG."""
    import cv2

    scaled: Any = image
    if image.shape[:2] != (parameters.height, parameters.width):
        scaled = cv2.resize(image, (parameters.width, parameters.height), interpolation=cv2.INTER_AREA)
    good, data = cv2.imencode(".jpg", scaled, [cv2.IMWRITE_JPEG_QUALITY, parameters.quality])
    if not good:
        raise UnavailableError("OpenCV could not encode the image")
    return bytes(data)


def run(context: Context, namespace: str, params: Mapping[str, str], stop: threading.Event) -> None:
    """Run a camera until `stop` is set, Ctrl-C, or the context's close."""
    parameters = read_parameters(params)
    if importlib.util.find_spec("cv2") is None:
        raise ConfigError("the camera needs OpenCV: install metaros with its extra `drivers`")
    camera = CameraNode(context, parameters, namespace=namespace)
    try:
        while not stop.wait(_LOOK_S) and not camera.ended:
            pass
    except KeyboardInterrupt:
        pass
    finally:
        camera.close()
