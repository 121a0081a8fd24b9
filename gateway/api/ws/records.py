"""The two forms in which the stream sends samples: binary records, and JSON texts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from gateway.api.ws.writer import BINARY, TEXT, frame, frame_header
from gateway.domain.records import record_parts
from gateway.live.encoding import Block, View
from gateway.live.json_view import json_view

__all__ = ["BinaryRecords", "JsonMessages"]


@dataclass(frozen=True, slots=True)
class BinaryRecords:
    """One binary message with a record of each sample."""

    view: ClassVar[View[Any] | None] = None
    subscription: int
    channel: int

    def encode(self, block: Block) -> bytes:
        """A block as one frame."""
        parts = record_parts(block.records, subscription=self.subscription, channel=self.channel)
        return b"".join((frame_header(BINARY, block.size_bytes), *parts))


@dataclass(frozen=True, slots=True)
class JsonMessages:
    """One text message of each sample; what cannot be decoded has the message null."""

    view: ClassVar[View[Any] | None] = json_view
    subscription: int
    channel: int

    def encode(self, block: Block) -> bytes:
        """A block as a frame for each sample."""
        head = b'{"op":"message","id":%d,"channel":%d,' % (self.subscription, self.channel)
        return b"".join(
            frame(
                TEXT,
                b'%b"seq":%d,"stamp_ms":%.6f,"receive_ms":%.6f,"message":%b}'
                % (head, record.seq, record.stamp_ns / 1e6, record.receive_ns / 1e6, shown or b"null"),
            )
            for record, shown in zip(block.records, block.views(json_view), strict=True)
        )
