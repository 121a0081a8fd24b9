"""The camera on the wire: JPEG, H.264, CameraInfo; what viewers ask for is done, and sources come back."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

import metaros
from metaros.convert import is_key_frame
from metaros.drivers.camera import source
from metaros.drivers.camera.encoders import encode_jpeg
from metaros.drivers.camera.source import TestPattern
from metaros.errors import ConfigError, ParameterError
from metaros.interfaces.foxglove_msgs.msg import CompressedVideo
from metaros.interfaces.metaros_msgs.msg import VideoDemand
from metaros.interfaces.sensor_msgs.msg import CameraInfo, CompressedImage
from metaros.interfaces.std_msgs.msg import String
from tests.support.devices.drivers import RunningDriver, running
from tests.support.ports import free_port
from tests.support.servers.rtsp_server import RtspServer
from tests.support.waiting import wait_until

SMALL = {"source": "test", "width": 160, "height": 120, "rate": 50}


def size_of(message: Any) -> tuple[int, int]:
    image = cv2.imdecode(np.asarray(message.data), cv2.IMREAD_COLOR)
    assert image is not None
    return image.shape[1], image.shape[0]


def test_jpeg_by_default(context: metaros.Context) -> None:
    with running("camera", SMALL | {"frame_id": "front"}, context=context) as camera:
        images = camera.messages(CompressedImage, "camera/image/compressed")
        wait_until(lambda: len(images) >= 20)
        assert (images[0].format, images[0].header.frame_id, size_of(images[0])) == ("jpeg", "front", (160, 120))
        assert images[0].header.stamp.sec > 1_700_000_000
        wait_until(lambda: camera.state() == "working" and float(camera.facts()["rate_hz"]) > 1)
        assert camera.status().message == "test, 160 x 120"


def test_both_outputs_show_the_same_moments(context: metaros.Context) -> None:
    with running("camera", SMALL | {"output": "both"}, context=context) as camera:
        images = camera.messages(CompressedImage, "camera/image/compressed")
        videos = camera.messages(CompressedVideo, "camera/video")
        wait_until(lambda: len(images) >= 10 and len(videos) >= 10)
        stamps = {(image.header.stamp.sec, image.header.stamp.nanosec) for image in images}
        wait_until(lambda: sum((v.timestamp.sec, v.timestamp.nanosec) in stamps for v in list(videos)) >= 3)
        assert {video.format for video in videos} == {"h264"}


def test_key_frames_and_bit_rates_are_as_asked(context: metaros.Context) -> None:
    settings = SMALL | {"output": "h264", "width": 320, "height": 240, "bitrate": 2_000_000}
    with running("camera", settings, context=context) as camera:
        videos = camera.messages(CompressedVideo, "camera/video")
        demand = camera.viewer.create_publisher(VideoDemand, "/r1/camera/video/demand", 10)
        wait_until(lambda: len(videos) > 5)
        wait_until(lambda: demand.publish(VideoDemand(key_frame=True, viewers=1)) or _keys(videos[5:]))
        wait_until(lambda: demand.publish(VideoDemand(viewers=1, bitrate_bps=250_000)) or _sizes(videos)[-1:] == [160])
        assert "160x" in camera.facts()["video"] or wait_until(lambda: "160x" in camera.facts()["video"]) is None
        for absurd in (2**32 - 1, 1):
            demand.publish(VideoDemand(key_frame=True, viewers=2**32 - 1, bitrate_bps=absurd))
        count = len(videos)
        wait_until(lambda: len(videos) > count + 5)
        assert camera.state() == "working"


def _keys(videos: list[Any]) -> int:
    return sum(is_key_frame(bytes(video.data), "h264") for video in list(videos))


def _sizes(videos: list[Any]) -> list[int]:
    decoder = av.CodecContext.create("h264", "r")
    frames = [frame for video in list(videos) for frame in decoder.decode(av.Packet(bytes(video.data)))]
    return [frame.width for frame in frames]


def test_on_demand_nothing_is_encoded_for_nobody(context: metaros.Context) -> None:
    settings = SMALL | {"output": "both", "on_demand": True}
    with running("camera", settings, context=context) as camera:
        images = camera.messages(CompressedImage, "camera/image/compressed")
        videos = camera.messages(CompressedVideo, "camera/video")
        demand = camera.viewer.create_publisher(VideoDemand, "/r1/camera/video/demand", 10)
        wait_until(lambda: len(images) > 10)
        assert not videos
        wait_until(lambda: demand.publish(VideoDemand(viewers=1)) or videos)
        assert is_key_frame(bytes(videos[0].data), "h264")


CALIBRATION = """
image_width: 320
image_height: 240
camera_name: front
camera_matrix: {rows: 3, cols: 3, data: [200, 0, 160, 0, 200, 120, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.3, 0.1, 0, 0, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [180, 0, 160, 0, 0, 180, 120, 0, 0, 0, 1, 0]}
"""


@pytest.mark.parametrize("rectify", [False, True])
def test_camera_info_goes_with_each_picture(context: metaros.Context, tmp_path: Path, rectify: bool) -> None:
    file = tmp_path / "front.yaml"
    file.write_text(CALIBRATION)
    settings = SMALL | {"calibration": str(file), "rectify": rectify, "output": "h264"}
    with running("camera", settings, context=context) as camera:
        infos = camera.messages(CameraInfo, "camera/camera_info")
        videos = camera.messages(CompressedVideo, "camera/video")
        wait_until(lambda: len(infos) > 5 and len(videos) > 5)
        info = infos[0]
        assert (info.width, info.height) == (160, 120)
        assert info.k.tolist()[:6] == ([90, 0, 80, 0, 90, 60] if rectify else [100, 0, 80, 0, 100, 60])
        assert info.d.tolist() == ([0.0] * 5 if rectify else [-0.3, 0.1, 0, 0, 0])
        stamps = {(info.header.stamp.sec, info.header.stamp.nanosec) for info in infos}
        wait_until(lambda: any((v.timestamp.sec, v.timestamp.nanosec) in stamps for v in list(videos)))


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"rectify": True}, "needs a calibration"),
        ({"calibration": "/no/such.yaml"}, "such.yaml"),
        ({"width": 7680, "height": 7680}, "at most 40000000"),
        ({"source": "env:NO_SUCH_VARIABLE"}, "not set"),
        ({"topic": "a b"}, "topic"),
    ],
)
def test_what_cannot_be_is_refused_at_configure(
    context: metaros.Context, settings: dict[str, Any], reason: str
) -> None:
    with running("camera", SMALL | settings, context=context, start=False) as camera:
        with pytest.raises(ConfigError, match=reason):
            camera.node.start()


def test_nobody_afar_chooses_the_source(context: metaros.Context) -> None:
    with running("camera", SMALL, context=context) as camera:
        for name in ("source", "calibration", "encoder", "topic"):
            with pytest.raises(ParameterError, match="read-only"):
                camera.node.parameters.set(name, "file:///etc/passwd")
        camera.node.parameters.set("quality", 5)


def test_simulated_faults(context: metaros.Context) -> None:
    with running("camera", SMALL | {"allow_faults": True}, context=context) as camera:
        images = camera.messages(CompressedImage, "camera/image/compressed")
        faults = camera.viewer.create_publisher(String, "/r1/camera/fault", 10)
        wait_until(lambda: faults.publish(String(data="unplug")) or camera.state() == "waiting")
        count = len(images)
        wait_until(lambda: faults.publish(String(data="clear")) or len(images) > count + 3)


# -- real peers --------------------------------------------------------------------------------------------------------


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "READ_TIMEOUT_MS", 300)


@pytest.mark.integration
@pytest.mark.usefixtures("impatient")
def test_an_rtsp_server_that_dies_and_returns(context: metaros.Context) -> None:
    with RtspServer(free_port()) as server:
        settings = {"source": server.url, "width": 160, "height": 120, "rate": 25}
        with running("camera", settings, context=context) as camera:
            images = camera.messages(CompressedImage, "camera/image/compressed")
            wait_until(lambda: len(images) > 5)
            server.kill()
            wait_until(lambda: camera.state() in ("waiting", "opening"))
            count = len(images)
            server.start()
            wait_until(lambda: len(images) > count + 5 and camera.state() == "working")
            assert int(camera.facts()["reconnects"]) >= 1


class _Mjpeg(BaseHTTPRequestHandler):
    """One moving picture as MJPEG, or a flood of nonsense under the same type."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        pattern, rng = TestPattern(320, 240), random.Random(3)
        try:
            if self.path == "/garbage":
                for _ in range(64):
                    self.wfile.write(rng.randbytes(16384))
                return
            while not self.server.over.wait(0.02):  # type: ignore[attr-defined]
                data = encode_jpeg(pattern.read(), 70)
                self.wfile.write(b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(data))
                self.wfile.write(data + b"\r\n")
        except OSError:
            pass

    def log_message(self, *_: Any) -> None:
        """Nothing."""


@contextmanager
def mjpeg_server() -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Mjpeg)
    server.over = threading.Event()  # type: ignore[attr-defined]
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.over.set()  # type: ignore[attr-defined]
        server.shutdown()
        server.server_close()
        thread.join()


def sees(camera: RunningDriver, width: int, height: int) -> None:
    images = camera.messages(CompressedImage, "camera/image/compressed")
    wait_until(lambda: len(images) > 5)
    assert size_of(images[-1]) == (width, height)


def test_mjpeg_over_http(context: metaros.Context) -> None:
    with mjpeg_server() as url:
        settings = {"source": f"{url}/stream.mjpeg", "width": 160, "height": 120, "rate": 30}
        with running("camera", settings, context=context) as camera:
            sees(camera, 160, 120)


def test_a_stream_of_garbage_is_waited_out(context: metaros.Context) -> None:
    with mjpeg_server() as url:
        with running("camera", {"source": f"{url}/garbage"}, context=context) as camera:
            wait_until(lambda: int(camera.facts().get("reconnects", 0)) >= 2)


@contextmanager
def transport_stream(port: int) -> Iterator[None]:
    """MPEG-TS over UDP."""
    over = threading.Event()

    def send() -> None:
        pattern = TestPattern(320, 240)
        with av.open(f"udp://127.0.0.1:{port}?pkt_size=1316", "w", format="mpegts") as out:
            stream = out.add_stream(
                "libx264", rate=25, options={"preset": "ultrafast", "tune": "zerolatency", "g": "12"}
            )
            stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
            while not over.wait(0.01):
                for packet in stream.encode(av.VideoFrame.from_ndarray(pattern.read(), format="bgr24")):
                    out.mux(packet)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(60)


@pytest.mark.usefixtures("impatient")
def test_a_transport_stream_over_udp_that_stops_and_returns(context: metaros.Context) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
    settings = {"source": f"udp://127.0.0.1:{port}", "width": 160, "height": 120, "rate": 25}
    with running("camera", settings, context=context) as camera:
        images = camera.messages(CompressedImage, "camera/image/compressed")
        with transport_stream(port):
            wait_until(lambda: len(images) > 5)
        wait_until(lambda: camera.state() in ("waiting", "stale", "opening"))
        count = len(images)
        with transport_stream(port):
            wait_until(lambda: len(images) > count + 5)
