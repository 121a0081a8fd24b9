"""Validates the Hello and the Announce of a link: every text and count is checked before it is used."""

from __future__ import annotations

import math
import re

from gateway.domain.channel import BULK, CLASSES, Channel, Series
from gateway.domain.robot import Robot, is_robot_id
from gateway.errors import ProtocolError
from metaros._proto import link_pb2
from metaros.errors import NameError_
from metaros.idl import names
from metaros.limits import Limits
from metaros.link.columns import MAX_SEQ

__all__ = ["LANES", "PROTOCOL", "check_hello", "read_channel", "read_series"]

PROTOCOL = 1
LANES = (link_pb2.LANE_CONTROL, link_pb2.LANE_DATA, link_pb2.LANE_BACKFILL)
MAX_LABELS = 32
MAX_TEXT = 256
MAX_WRITERS = 256
MAX_EPOCHS = 4096

_TYPE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/(msg|srv|action))?/[A-Za-z][A-Za-z0-9_]*")


def check_hello(hello: link_pb2.Hello, *, limits: Limits) -> Robot:
    """The robot a Hello speaks for; ProtocolError names what is wrong with it."""
    if hello.protocol != PROTOCOL:
        raise ProtocolError(f"this gateway speaks link protocol {PROTOCOL}, the agent {hello.protocol}")
    if not is_robot_id(hello.robot_id):
        raise ProtocolError(f"robot id {hello.robot_id[:80]!r} is not 1 to 64 of letters, digits, '_', '.', '-'")
    if len(hello.session_id) != 16:
        raise ProtocolError(f"a session id has 16 bytes, not {len(hello.session_id)}")
    if hello.lane not in LANES:
        raise ProtocolError(f"lane {hello.lane} is not served here")
    if hello.session_number >= 2**63:
        raise ProtocolError("the session number is out of range")
    if len(hello.streams) > 2 * limits.channels_per_robot:
        raise ProtocolError(f"{len(hello.streams)} streams are over the limit of {2 * limits.channels_per_robot}")
    if len(hello.epochs) > MAX_EPOCHS:
        raise ProtocolError(f"{len(hello.epochs)} epochs are over the limit of {MAX_EPOCHS}")
    if len(hello.writers) > MAX_WRITERS or any(not 1 <= len(writer) <= 64 for writer in hello.writers):
        raise ProtocolError(f"a Hello names at most {MAX_WRITERS} writers of 1 to 64 characters")
    if any(not 0 <= s.base_seq <= s.last_seq <= MAX_SEQ for s in hello.streams):
        raise ProtocolError("a stream's numbers are out of range")
    texts = [hello.agent_version, hello.hostname, *hello.labels.keys(), *hello.labels.values()]
    if len(hello.labels) > MAX_LABELS or any(len(text) > MAX_TEXT for text in texts):
        raise ProtocolError(f"a Hello has at most {MAX_LABELS} labels and texts of {MAX_TEXT} characters")
    namespace = hello.namespace or "/"
    try:
        names.validate_namespace(namespace)
    except NameError_ as error:
        raise ProtocolError(f"namespace: {error}") from error
    return Robot(hello.robot_id, namespace, hello.hostname, hello.agent_version, dict(hello.labels))


def read_channel(robot: str, channel: link_pb2.Channel, *, limits: Limits) -> Channel:
    """An announced channel; ProtocolError names the field that does not fit."""
    if channel.channel_id < 1:
        raise ProtocolError("channel ids start at 1")
    try:
        names.validate_topic(channel.topic)
    except NameError_ as error:
        raise ProtocolError(f"channel {channel.channel_id}: topic: {error}") from error
    if len(channel.schema_name) > MAX_TEXT or _TYPE_NAME.fullmatch(channel.schema_name) is None:
        raise ProtocolError(f"channel {channel.channel_id}: {channel.schema_name[:80]!r} is no type name")
    texts = (channel.encoding, channel.schema_encoding, channel.type_hash, channel.qos)
    if any(len(text) > MAX_TEXT for text in texts):
        raise ProtocolError(f"channel {channel.channel_id}: a text is over {MAX_TEXT} characters")
    if len(channel.schema) > limits.schema_bytes:
        raise ProtocolError(f"channel {channel.channel_id}: its schema is over {limits.schema_bytes} bytes")
    if getattr(channel, "class") not in CLASSES:
        raise ProtocolError(f"channel {channel.channel_id}: no such delivery class")
    if not 0 <= channel.max_rate_hz < math.inf:
        raise ProtocolError(f"channel {channel.channel_id}: max_rate_hz is no rate")
    if not 0 <= channel.history_rate_hz < math.inf:
        raise ProtocolError(f"channel {channel.channel_id}: history_rate_hz is no rate")
    if channel.history and CLASSES[getattr(channel, "class")] != BULK:
        raise ProtocolError(f"channel {channel.channel_id}: a history channel is of class bulk")
    return Channel(
        robot=robot,
        channel_id=channel.channel_id,
        topic=channel.topic,
        schema_name=channel.schema_name,
        type_hash=channel.type_hash,
        encoding=channel.encoding,
        schema_encoding=channel.schema_encoding,
        schema=channel.schema,
        qos=channel.qos,
        delivery=CLASSES[getattr(channel, "class")],
        max_rate_hz=channel.max_rate_hz,
        forward=channel.forward,
        history=channel.history,
        history_rate_hz=channel.history_rate_hz,
    )


def read_series(series: link_pb2.Series) -> Series:
    """An announced series; ProtocolError names what does not fit."""
    if series.series_id < 1:
        raise ProtocolError("series ids start at 1")
    if not 1 <= len(series.name) <= 2 * MAX_TEXT or max(len(series.topic), len(series.field)) > 2 * MAX_TEXT:
        raise ProtocolError(f"series {series.series_id}: name, topic and field have up to {2 * MAX_TEXT} characters")
    return Series(series.name, series.topic, series.field)
