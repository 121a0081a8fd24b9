"""The camera node on a real router: images arrive, failures heal, close is quick."""

from __future__ import annotations

import time
from queue import Queue
from typing import Any

import pytest

import metaros
from metaros.drivers import driver_kinds, run_driver
from metaros.drivers.camera.node import CameraNode
from metaros.drivers.camera.parameters import CameraParameters
from metaros.drivers.camera.source import Source, TestPattern
from metaros.errors import ConfigError, UnavailableError
from metaros.interfaces.sensor_msgs.msg import CompressedImage
from tests.support.waiting import wait_until


class Flaky(TestPattern):
    """Fails after two images."""

    def __init__(self) -> None:
        super().__init__(64, 48)
        self.left = 2

    def read(self) -> Any:
        self.left -= 1
        if self.left < 0:
            raise UnavailableError("unplugged")
        return super().read()


def test_images_arrive_at_the_rate(zenoh_router: str) -> None:
    parameters = CameraParameters(source="test", rate=50, width=160, height=120, frame_id="front")
    with metaros.Context(connect=zenoh_router) as context:
        images: Queue[CompressedImage] = Queue()
        viewer = metaros.Node("viewer", context=context)
        viewer.create_subscription(
            CompressedImage, "/sim_1/camera/image/compressed", images.put, metaros.qos_sensor_data
        )
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(viewer)
        camera = CameraNode(context, parameters, namespace="/sim_1")
        try:
            started = time.monotonic()
            while images.qsize() < 20:
                executor.spin_once(0.1)
                assert time.monotonic() - started < 60
            took = time.monotonic() - started
        finally:
            camera.close()
            executor.shutdown()
    image = images.get()
    assert (image.format, image.header.frame_id) == ("jpeg", "front")
    assert bytes(image.data[:2]) == b"\xff\xd8"
    assert image.header.stamp.sec > 1_700_000_000
    assert took >= 0.3


def test_a_source_that_fails_is_opened_again(zenoh_router: str) -> None:
    opened: list[Source] = []

    def open_(_: CameraParameters) -> Source:
        if len(opened) == 1:
            opened.append(Flaky())
            raise UnavailableError("still unplugged")
        opened.append(Flaky())
        return opened[-1]

    with metaros.Context(connect=zenoh_router) as context:
        camera = CameraNode(context, CameraParameters(source="test", rate=100, width=64, height=48), open_=open_)
        try:
            wait_until(lambda: camera.published >= 4)
        finally:
            started = time.monotonic()
            camera.close()
            assert time.monotonic() - started < 60
    assert len(opened) >= 3


def test_unknown_kinds_and_parameters_are_refused(zenoh_router: str) -> None:
    assert driver_kinds() == ("camera",)
    with metaros.Context(connect=zenoh_router) as context:
        with pytest.raises(ConfigError, match="no driver 'toaster'"):
            run_driver("toaster", {}, context=context)
        with pytest.raises(ConfigError, match="no parameter"):
            run_driver("camera", {"x": "1"}, context=context)


def test_a_closed_context_ends_the_driver(zenoh_router: str) -> None:
    context = metaros.Context(connect=zenoh_router)
    camera = CameraNode(context, CameraParameters(source="test", rate=100, width=64, height=48))
    wait_until(lambda: camera.published)
    context.close()
    wait_until(lambda: camera.ended, timeout_s=60)
    camera.close()
