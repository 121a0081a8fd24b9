"""Targets of the ROS side: CDR, field readers, definitions, types that peers tell of, keys, tokens, attachments."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from metaros.cdr import codec
from metaros.cdr.reader import field_reader
from metaros.errors import (
    AttachmentError,
    DecodeError,
    DefinitionError,
    FieldError,
    NameError_,
    TokenError,
    TypeHashError,
    UnknownTypeError,
)
from metaros.idl import (
    Catalogue,
    add_schema_text,
    default_catalogue,
    definition_text,
    message_class,
    parse_definition,
    schema_text,
    type_hash,
)
from metaros.idl.globs import Glob
from metaros.idl.hashing import parse_hash
from metaros.idl.json import from_json, to_json
from metaros.idl.known import remember
from metaros.node.introspection import type_description
from metaros.node.introspection.described import learn
from metaros.wire.attachment import Attachment, pack_attachment, parse_attachment
from metaros.wire.keys import DataKey, parse_key
from metaros.wire.liveliness_tokens import EndpointToken, NodeToken, parse_token
from metaros.wire.qos import QoSProfile, qos_rosout, qos_sensor_data
from tests.security.fuzz.target import MIB, Target

__all__ = ["TARGETS", "text_of"]

# With something in each: numbers that are aligned in every way, texts, sequences of messages, arrays of every size.
MESSAGES: dict[str, dict[str, Any]] = {
    "std_msgs/msg/String": {"data": "hello"},
    "std_msgs/msg/Empty": {},
    "example_interfaces/msg/WString": {"data": "grüße 🤖"},
    "std_msgs/msg/Float64MultiArray": {"data": [1.0, 2.0], "layout": {"dim": [{"label": "x", "size": 2}]}},
    "sensor_msgs/msg/BatteryState": {"cell_voltage": [3.5, 3.6], "location": "left"},
    "sensor_msgs/msg/JointState": {"name": ["a", "bc"], "position": [1.0, 2.0], "velocity": [0.5]},
    "sensor_msgs/msg/PointCloud2": {"fields": [{"name": "x", "datatype": 7, "count": 1}], "data": [1, 2, 3, 4]},
    "sensor_msgs/msg/NavSatFix": {"position_covariance": [0.0] * 9},
    "diagnostic_msgs/msg/DiagnosticArray": {"status": [{"name": "n", "values": [{"key": "k", "value": "v"}]}]},
    "tf2_msgs/msg/TFMessage": {"transforms": [{"child_frame_id": "a"}, {"child_frame_id": "b"}]},
    "nav_msgs/msg/Odometry": {"child_frame_id": "base"},
    "rcl_interfaces/msg/ParameterEvent": {
        "node": "/n",
        "new_parameters": [{"name": "p", "value": {"type": 9, "string_array_value": ["x", "y"]}}],
    },
}
PATHS: dict[str, tuple[str, ...]] = {
    "sensor_msgs/msg/BatteryState": ("percentage", "cell_voltage[1]"),
    "sensor_msgs/msg/JointState": ("position[1]", "effort[0]"),
    "tf2_msgs/msg/TFMessage": ("transforms[1].transform.rotation.w",),
    "nav_msgs/msg/Odometry": ("pose.pose.position.x", "twist.twist.angular.z"),
}
SCHEMA_ERRORS = (DefinitionError, UnknownTypeError, DecodeError, FieldError)
DEFINITION = """# a comment
uint8 OK=0
string<=10 GREETING="hi # there"
float32[3] axis [1, 2, 3]
int64[<=5] few
string[] names ["a", 'b']
geometry_msgs/Point[2] corners
bool on true
"""


def text_of(data: bytes) -> str:
    """Foreign bytes where the program already has text: as protobuf, JSON and Zenoh give it."""
    return data.decode("utf-8", "replace")


def seeds_of(name: str) -> tuple[bytes, ...]:
    """A message with content and an empty one, and the first in the other byte order (as far as it can be)."""
    kind = codec(name)
    full, empty = kind.encode(from_json(name, MESSAGES[name])), kind.encode(from_json(name, {}))
    return full, empty, b"\0\0\0\0" + full[4:]


def cdr(name: str) -> Target:
    """Decode, as a subscription does, as the gateway does where it shows JSON, and from a view."""

    def run(data: bytes) -> None:
        message = codec(name).decode(data)
        to_json(message)
        codec(name).decode(memoryview(data))

    return Target(name=f"cdr {name}", run=run, errors=(DecodeError,), seeds=seeds_of(name))


def reader(name: str, paths: tuple[str, ...]) -> Target:
    """The numbers that the agent takes out of samples as metrics."""

    def run(data: bytes) -> None:
        values = field_reader(name, paths)(data)
        assert len(values) == len(paths)
        assert all(isinstance(value, float) or math.isnan(value) for value in values)

    return Target(name=f"fields {name}", run=run, errors=(DecodeError,), seeds=seeds_of(name))


def definition(kind: str, text: str) -> Target:
    """A definition's text; what is read must be written, and read again, as the same."""

    def run(data: bytes) -> None:
        found = parse_definition(text_of(data), f"fuzz_msgs/{kind}/Thing")
        assert parse_definition(definition_text(found), f"fuzz_msgs/{kind}/Thing") == found

    return Target(name=f"{kind} text", run=run, errors=(DefinitionError,), seeds=(text.encode(), b"string data\n"))


def announced_schema(data: bytes) -> None:
    """What a gateway makes of a schema that a robot announced, and of a payload of that type."""
    text, _, payload = data.partition(b"\0\0\0")
    catalogue = Catalogue()
    add_schema_text("fuzz_msgs/msg/Thing", text_of(text), catalogue)
    type_hash("fuzz_msgs/msg/Thing", catalogue)
    kind = codec("fuzz_msgs/msg/Thing", catalogue)
    schema_text("fuzz_msgs/msg/Thing", catalogue)
    to_json(kind.decode(payload))


def reported_type(data: bytes) -> None:
    """A peer's answer to `~/get_type_description`."""
    response = codec("type_description_interfaces/srv/GetTypeDescription_Response").decode(data)
    learn("fuzz_msgs/msg/Told", TOLD_HASH, response)


def reported_seeds() -> tuple[str, tuple[bytes, ...]]:
    """A type that no catalogue has, as a node describes it, with and without sources."""
    catalogue = Catalogue(base=default_catalogue())
    catalogue.add(parse_definition("float64[<=3] x\ngeometry_msgs/Point[] points\n", "fuzz_msgs/msg/Told"))
    hash_text = remember("fuzz_msgs/msg/Told", catalogue)
    request = message_class("type_description_interfaces/srv/GetTypeDescription_Request")
    answers = []
    for sources in (True, False):
        response = message_class("type_description_interfaces/srv/GetTypeDescription_Response")()
        type_description._describe(
            request(type_name="fuzz_msgs/msg/Told", type_hash=hash_text, include_type_sources=sources), response
        )
        answers.append(codec(type(response)).encode(response))
    return hash_text, tuple(answers)


TOLD_HASH, TOLD = reported_seeds()


def text_target(name: str, run: Callable[[str], Any], errors: tuple[type[Exception], ...], *seeds: str) -> Target:
    """A target that takes text."""
    return Target(
        name=name, run=lambda data: run(text_of(data)), errors=errors, seeds=tuple(seed.encode() for seed in seeds)
    )


def tokens() -> tuple[str, ...]:
    """A node's and two endpoints'."""
    node = NodeToken(0, "ab12", 0, "base", "/sim_1")
    kind = "std_msgs/msg/String"
    ends = [
        EndpointToken(node, 7, kind_, "/sim_1/chatter", kind, type_hash(kind), qos.encode(), backends)
        for kind_, qos, backends in (("MP", qos_rosout, None), ("MS", qos_sensor_data, "backends:shm"))
    ]
    return (str(node), *map(str, ends))


def matched(text: str) -> None:
    """A pattern that a client sends, on the worst of names."""
    pattern, _, topic = text.partition("\n")
    for separator in "/.":
        Glob(pattern, separator=separator).matches(topic[:512])


KEY = str(DataKey(0, "/sim_1/odom", "nav_msgs/msg/Odometry", type_hash("nav_msgs/msg/Odometry")))
ATTACHMENT = pack_attachment(5, 1_700_000_000_000_000_000, bytes(range(16)))
OLD_ATTACHMENT = (
    b"\x0fsequence_number" + bytes(8) + b"\x10source_timestamp" + bytes(8) + b"\x0asource_gid\x10" + bytes(16)
)
assert parse_attachment(OLD_ATTACHMENT) == Attachment(0, 0, bytes(16))

TARGETS = (
    *map(cdr, MESSAGES),
    *(reader(name, paths) for name, paths in PATHS.items()),
    definition("msg", DEFINITION),
    definition("srv", "int64 a\n---\nint64 sum 3\n"),
    definition("action", "int32 order\n---\nint32[] all\n---\nint32[] so_far\n"),
    Target(
        name="announced schema",
        run=announced_schema,
        errors=SCHEMA_ERRORS,
        seeds=tuple(
            schema_text(name).encode() + b"\0\0\0" + codec(name).encode(from_json(name, MESSAGES.get(name, {})))
            for name in ("diagnostic_msgs/msg/DiagnosticArray", "nav_msgs/msg/Odometry", "std_msgs/msg/String")
        ),
        base_bytes=16 * MIB,
        per_byte=2000,  # code is made of it
        cost=12,
    ),
    Target(
        name="told type",
        run=reported_type,
        errors=(DecodeError, UnknownTypeError, TypeHashError, DefinitionError),
        seeds=TOLD,
        base_bytes=16 * MIB,
        per_byte=2000,
        cost=5,
    ),
    text_target("data key", parse_key, (NameError_,), KEY, "0/a/b::msg::dds_::C_/TypeHashNotSupported"),
    text_target("liveliness token", lambda text: str(parse_token(text)), (TokenError,), *tokens()),
    text_target("qos of a token", QoSProfile.decode, (TokenError,), qos_rosout.encode(), qos_sensor_data.encode()),
    text_target("type hash", parse_hash, (DefinitionError,), type_hash("std_msgs/msg/String")),
    text_target("pattern", matched, (NameError_,), "/a/**/b*c*\n/a/x/y/bbcbbc", "**\n" + "/a" * 40, "a.*.**\na.b.c"),
    Target(name="attachment", run=parse_attachment, errors=(AttachmentError,), seeds=(ATTACHMENT, OLD_ATTACHMENT)),
)
