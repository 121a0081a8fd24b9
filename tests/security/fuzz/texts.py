"""Targets of settings, other programs' JSON and pictures: TOML, YAML, the ZeroMQ broker, images, clouds, addresses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from edge_agent.config.gateway_address import parse_address
from edge_agent.config.settings import load_settings
from gateway.identity.oidc.settings import OidcSettings
from gateway.store.objects import urls
from metaros.broker.frames import join, parse_payload, ros_topic, split
from metaros.broker.raw_payload import raw_data
from metaros.broker.type_inference import infer_type
from metaros.broker.v1_json import from_payload, to_payload
from metaros.cdr import codec
from metaros.convert.audio import audio_to_numpy
from metaros.convert.compressed import compressed_to_numpy, image_file_size, numpy_to_compressed
from metaros.convert.image import image_to_numpy, numpy_to_image
from metaros.convert.points import numpy_to_points, points_rgb, points_to_numpy, points_xyz
from metaros.convert.video import is_key_frame
from metaros.errors import ConfigError, DecodeError, FieldError, FrameError, TooLargeError
from metaros.idl import message_class
from metaros.interfaces.sensor_msgs.msg import CompressedImage
from metaros.node.parameters.files import load_text, parse_value
from metaros.supervise.launch_table import parse_table
from tests.security.fuzz.files import on_disk
from tests.security.fuzz.target import MIB, Target
from tests.security.fuzz.wire import text_of

__all__ = ["TARGETS"]

AGENT = b"""name = "r1"
namespace = "/r1"
gateway = "127.0.0.1:8081"
exclude = ["/other/**"]
[labels]
site = "x"
[outbox]
event_bytes = 100000
[black_box]
quota_bytes = 100000000
[[topics]]
match = "**/odom"
class = "live"
max_rate_hz = 5.0
fields = ["pose.pose.position.x"]
"""
LAUNCH = """safe_stop = ["true"]
[[node]]
name = "base"
module = "metaros.sim.main"
args = ["--x"]
after = []
restart = "always"
parameters = {max_speed = 0.5}
"""
PARAMETERS = """/**:
  ros__parameters:
    use_sim_time: false
/sim_1/base:
  ros__parameters: {max_speed: 0.5, names: [a, b], motor: {gain: 1.0}}
"""
OIDC = {
    "issuer": "https://id.example",
    "client_id": "metaros",
    "redirect_url": "https://gw.example/api/v1/auth/oidc/callback",
    "roles": {"admin": ["robot-admins"]},
}
PAYLOADS: tuple[Any, ...] = (
    {"linear": {"x": 0.5, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 1}},
    {"header": {"seq": 1, "stamp": 5.5, "frame_id": "a"}, "ranges": [1.0, None], "angles": [0.1]},
    {"data": [1, 2, 3]},
    {"header": {"stamp": {"secs": 1, "nsecs": 2}}, "poses": [{"pose": {"position": {"x": 1}}, "covariance": []}]},
    "text",
    5,
)
KINDS = ("geometry_msgs/msg/Twist", "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Path", "std_msgs/msg/UInt8MultiArray")


def broker_message(data: bytes) -> None:
    """A ZeroMQ message on its way to ROS, as every type that it could be, and back."""
    topic, payload = split(data.split(b"\xfe\xff", 2))
    ros_topic(topic)
    value = parse_payload(payload)
    for kind in (infer_type(value), *KINDS):
        try:
            plain = raw_data(kind, value, payload)
            cls = message_class(kind)
            message = cls(data=plain) if plain is not None else from_payload(cls, value, ignored=lambda _: None)
            codec(cls).encode(message)
            join(topic, to_payload(message), two_frames=False)
        except FieldError:
            continue


def agent_settings(data: bytes) -> None:
    """The agent's TOML."""
    on_disk(data, lambda path: load_settings(path), name="agent.toml")


def picture(data: bytes) -> None:
    """A camera's JPEG or PNG; most are far too small to be of interest to a decoder, and all are bounded before."""
    width, height = image_file_size(data)
    if width * height <= MIB:  # the decoder's own memory is not ours to judge
        pixels = compressed_to_numpy(CompressedImage(format="jpeg", data=data))
        assert pixels.ndim in (2, 3)


def image(data: bytes) -> None:
    """A raw image, as itself and in other colours."""
    message = codec("sensor_msgs/msg/Image").decode(data)
    for encoding in ("", "rgb8", "mono8"):
        try:
            image_to_numpy(message, encoding)
        except FieldError:
            continue


def cloud(data: bytes) -> None:
    """A point cloud."""
    message = codec("sensor_msgs/msg/PointCloud2").decode(data)
    points_to_numpy(message)
    for read in (points_xyz, points_rgb):
        try:
            read(message)
        except FieldError:
            continue


def sound(data: bytes) -> None:
    """Audio, and packets of video."""
    for name in ("h264", "h265", "vp8"):
        is_key_frame(data, name)
    audio_to_numpy(codec("foxglove_msgs/msg/RawAudio").decode(data))


def encoded(extension: str) -> bytes:
    """A small picture."""
    kind = "png" if extension == "png" else "jpeg"
    return bytes(np.asarray(numpy_to_compressed(np.arange(48, dtype=np.uint8).reshape(4, 4, 3), kind).data))


def text_target(
    name: str, run: Callable[[str], Any], errors: tuple[type[Exception], ...], *seeds: str, cost: int = 2
) -> Target:
    """A target that takes text."""
    return Target(
        name=name,
        run=lambda data: run(text_of(data)),
        errors=errors,
        seeds=tuple(seed.encode() for seed in seeds),
        per_byte=3000,
        cost=cost,
    )


CLOUD = numpy_to_points(np.arange(12, dtype=np.float32).reshape(4, 3), rgb=np.zeros((4, 3), np.uint8))

TARGETS = (
    Target(
        name="broker message",
        run=broker_message,
        errors=(FrameError, FieldError, TooLargeError),
        seeds=(
            *(b"/a " + json.dumps(value).encode() for value in PAYLOADS),
            b"/a\xfe\xff" + json.dumps(PAYLOADS[0]).encode(),
        ),
        per_byte=3000,
    ),
    Target(name="agent settings", run=agent_settings, errors=(ConfigError,), seeds=(AGENT,), per_byte=3000, cost=3),
    text_target("launch table", lambda text: parse_table(text, Path("/nowhere/a.toml")), (ConfigError,), LAUNCH),
    text_target("parameter file", lambda text: load_text(text, "/sim_1/base"), (ConfigError,), PARAMETERS, cost=6),
    text_target("parameter value", parse_value, (), "[1, 2.5, a]", "0x10", "{a: 1}", "1e-3", "2026-01-01"),
    text_target("gateway address", parse_address, (ConfigError,), "h:1", "grpcs://[::1]:8081", "https://a.example/b/c"),
    text_target(
        "objects url", urls.check_objects_url, (ConfigError,), "file:///a%20b", "s3://bucket/a?endpoint=http://h:1"
    ),
    Target(
        name="oidc settings",
        run=lambda data: on_disk(data, lambda path: OidcSettings.load(path), name="oidc.json"),
        errors=(ConfigError,),
        seeds=(json.dumps(OIDC).encode(),),
        cost=5,
    ),
    Target(
        name="picture",
        run=picture,
        errors=(DecodeError, TooLargeError, FieldError),
        seeds=(encoded("jpeg"), encoded("png")),
        base_bytes=16 * MIB,
    ),
    Target(
        name="image",
        run=image,
        errors=(DecodeError,),
        seeds=(
            codec("sensor_msgs/msg/Image").encode(numpy_to_image(np.zeros((3, 4, 3), np.uint8), "bgr8")),
            codec("sensor_msgs/msg/Image").encode(numpy_to_image(np.zeros((2, 2), np.uint16), "mono16")),
        ),
    ),
    Target(name="cloud", run=cloud, errors=(DecodeError,), seeds=(codec("sensor_msgs/msg/PointCloud2").encode(CLOUD),)),
    Target(
        name="audio and video",
        run=sound,
        errors=(DecodeError,),
        seeds=(
            codec("foxglove_msgs/msg/RawAudio").encode(
                message_class("foxglove_msgs/msg/RawAudio")(
                    data=[0, 1, 2, 3], format="pcm-s16", sample_rate=8000, number_of_channels=1
                )
            ),
        ),
    ),
)
