"""A message of a local topic as the event that a handler gets: in the very shape that the gateway gives it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final

__all__ = ["TOPIC_MESSAGE", "ReceivedMessage", "event_of"]

TOPIC_MESSAGE: Final = "metaros.topic.message"
SOURCE: Final = "metaros.topic"
ACCOUNT, REGION = "000000000000", "local"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedMessage:
    """A message, decoded as the gateway decodes it. `gid` is its publisher's, whose `seq` counts up."""

    topic: str
    type: str
    stamp_ns: int
    seq: int
    gid: bytes
    message: Any


def event_of(received: ReceivedMessage, *, robot: str) -> dict[str, Any]:
    """The EventBridge shape. Its id is that of the message, however often it is received."""
    stamp = datetime.fromtimestamp(received.stamp_ns / 1e9, UTC).isoformat(timespec="seconds")
    return {
        "version": "0",
        "id": f"{robot}{received.topic}/{received.gid.hex()}/{received.seq}",
        "detail-type": TOPIC_MESSAGE,
        "source": SOURCE,
        "account": ACCOUNT,
        "time": stamp.replace("+00:00", "Z"),
        "region": REGION,
        "resources": [f"arn:metaros:robot:{robot}"],
        "detail": {
            "robot": robot,
            "topic": received.topic,
            "type": received.type,
            "stamp_ns": received.stamp_ns,
            "seq": received.seq,
            "message": received.message,
        },
    }
