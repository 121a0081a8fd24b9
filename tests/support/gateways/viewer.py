"""A viewer of `/api/v1/stream` and a driver on the teleop socket, as a browser would be."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from websockets.sync.client import ClientConnection, connect

from tests.support.gateways.memory_authenticator import bearer

__all__ = ["Record", "open_socket", "records", "subscribe"]

HEADER = struct.Struct("<IIIIQqq")


@dataclass(frozen=True)
class Record:
    """One sample as it arrived."""

    subscription: int
    channel: int
    seq: int
    stamp_ns: int
    payload: bytes


def open_socket(url: str, path: str, *, key: str = "", **options: Any) -> ClientConnection:
    """A WebSocket to the gateway from the page's own origin; with a key, of whom it belongs to."""
    place, headers = url.replace("http", "ws", 1) + path, bearer(key)
    return connect(place, origin=url, max_size=None, compression=None, additional_headers=headers, **options)


def records(frame: bytes) -> Iterator[Record]:
    """The records in one binary frame."""
    at = 0
    while at < len(frame):
        size, subscription, channel, payload_bytes, seq, stamp_ns, _received = HEADER.unpack_from(frame, at)
        start = at + HEADER.size
        yield Record(subscription, channel, seq, stamp_ns, frame[start : start + payload_bytes])
        at += size


def subscribe(socket: ClientConnection, number: int, robots: str, topics: str, **options: Any) -> None:
    """Ask for topics."""
    socket.send(json.dumps({"op": "subscribe", "id": number, "robots": robots, "topics": topics, **options}))
