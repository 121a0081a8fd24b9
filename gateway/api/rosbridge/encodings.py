"""What rosbridge subscribers of a topic get, made once for all who want it the same way.

A sample is decoded to JSON or CBOR once, whatever the clients call its topic; the op around it is made once per name,
compression and size of pieces.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, cast

import cbor2

from gateway.api.rosbridge.dialect import decoded
from gateway.api.rosbridge.fragmentation import fragments, png_message
from gateway.api.rosbridge.from_message import cbor_values, json_bytes, json_values
from gateway.api.rosbridge.requests import Shape
from gateway.api.ws.writer import BINARY, TEXT, frame, frame_header
from gateway.domain.channel import Channel
from gateway.domain.records import Record
from gateway.live.encoding import Block, Encoding, View

__all__ = ["cbor_view", "encoding_of", "json_view"]

MAX_PICTURES = 1024  # topics as clients call them, of which pictures are made


def json_view(channel: Channel, record: Record) -> bytes:
    """The message as JSON in rosbridge's dialect."""
    return json_bytes(json_values(decoded(channel, record.payload)))


def cbor_view(channel: Channel, record: Record) -> bytes:
    """The message as CBOR."""
    return cbor2.dumps(cbor_values(decoded(channel, record.payload)))


def encoding_of(topic: str, shape: Shape) -> Encoding:
    """How a client that calls the topic `topic` gets its samples."""
    if shape.compression == "cbor":
        return CborPublish(topic)
    if shape.compression == "cbor-raw":
        return RawPublish(topic)
    if shape.compression == "png":
        return cast(Encoding, PicturePublish(topic, shape.fragment_size))
    return JsonPublish(topic, shape.fragment_size)


@dataclass(frozen=True, slots=True)
class JsonPublish:
    """A JSON text a sample, in pieces where it is longer than `fragment_size` characters."""

    topic: str
    fragment_size: int | None
    view: ClassVar[View[Any] | None] = json_view

    def encode(self, block: Block) -> bytes:
        """The samples' frames; one that is no message of its type is left out."""
        head = _json_head(self.topic)
        made = [made for made in block.views(json_view) if made is not None]
        if self.fragment_size is not None:
            return b"".join(_in_pieces([head + one + b"}" for one in made], block, self.fragment_size))
        parts: list[bytes] = []
        for one in made:
            parts += (frame_header(TEXT, len(head) + len(one) + 1), head, one, b"}")
        return b"".join(parts)


@dataclass(frozen=True, slots=True)
class PicturePublish:
    """The same as a picture of it, which takes its time: a view of the topic's own."""

    topic: str
    fragment_size: int | None

    @property
    def view(self) -> View[Any]:
        """The view that is this topic's: two calls give the same function."""
        return _picture_view(self.topic)

    def encode(self, block: Block) -> bytes:
        """The samples' frames."""
        texts = [made for made in block.views(self.view) if made is not None]
        if self.fragment_size is None:
            return b"".join([frame(TEXT, text) for text in texts])
        return b"".join(_in_pieces(texts, block, self.fragment_size))


@dataclass(frozen=True, slots=True)
class CborPublish:
    """A binary message a sample."""

    topic: str
    view: ClassVar[View[Any] | None] = cbor_view

    def encode(self, block: Block) -> bytes:
        """The samples' frames."""
        head = _cbor_head(self.topic)
        return b"".join([frame(BINARY, head + made) for made in block.views(cbor_view) if made is not None])


@dataclass(frozen=True, slots=True)
class RawPublish:
    """The bytes that the robot's node published, with their stamp, undecoded."""

    topic: str
    view: ClassVar[View[Any] | None] = None

    def encode(self, block: Block) -> bytes:
        """The samples' frames."""
        head, frames = _cbor_head(self.topic), []
        for record in block.records:
            secs, nsecs = divmod(record.stamp_ns, 1_000_000_000)
            message = {"secs": secs, "nsecs": nsecs, "bytes": bytes(record.payload)}
            frames.append(frame(BINARY, head + cbor2.dumps(message)))
        return b"".join(frames)


@lru_cache(maxsize=1024)
def _json_head(topic: str) -> bytes:
    return b'{"op":"publish","topic":' + json_bytes(topic) + b',"msg":'


@lru_cache(maxsize=1024)
def _cbor_head(topic: str) -> bytes:
    """A CBOR map of three, of which the value of `msg` is to come."""
    return b"\xa3" + b"".join(cbor2.dumps(text) for text in ("op", "publish", "topic", topic, "msg"))


@lru_cache(maxsize=MAX_PICTURES)
def _picture_view(topic: str) -> Callable[[Channel, Record], bytes]:
    def view(channel: Channel, record: Record) -> bytes:
        return png_message(_json_head(topic) + json_view(channel, record) + b"}")

    return view


def _in_pieces(texts: list[bytes], block: Block, size: int) -> list[bytes]:
    made = []
    for number, text in enumerate(texts):
        first = block.records[0].seq
        name = f"{block.channel.robot}:{block.channel.channel_id}:{first}:{number}"
        made += [frame(TEXT, piece) for piece in fragments(text.decode(), size=size, name=name)]
    return made
