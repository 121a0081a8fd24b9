"""Samples as Foxglove MessageData, framed for a WebSocket: made once for all clients with the same subscription id."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from gateway.api.foxglove.binary import message_head
from gateway.api.ws.writer import BINARY, frame_header
from gateway.live.encoding import Block, View

__all__ = ["MessageData"]


@dataclass(frozen=True, slots=True)
class MessageData:
    """A channel's samples under a client's subscription id, in the encoding that the robot's node published."""

    view: ClassVar[View[Any] | None] = None

    subscription_id: int

    def encode(self, block: Block) -> bytes:
        """One binary message a sample."""
        parts: list[bytes] = []
        number = self.subscription_id
        for record in block.records:
            head = message_head(number, record.stamp_ns)
            parts += (frame_header(BINARY, len(head) + len(record.payload)), head, record.payload)
        return b"".join(parts)
