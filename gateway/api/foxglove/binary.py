"""The binary messages of the Foxglove protocol: an opcode byte, then little-endian fields. Pure.

Times are nanoseconds since 1970 as unsigned 64-bit numbers.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from gateway.errors import InvalidRequestError

__all__ = [
    "CLIENT_DATA",
    "PLAYBACK",
    "SERVICE_CALL",
    "ClientData",
    "PlaybackControl",
    "ServiceCall",
    "asset_failure",
    "asset_response",
    "message_head",
    "playback_state",
    "read_binary",
    "service_response",
    "time_message",
]

# What the server sends,
MESSAGE, TIME, SERVICE_RESPONSE, ASSET, STATE = 1, 2, 3, 4, 5
# and what a client sends.
CLIENT_DATA, SERVICE_CALL, PLAYBACK = 1, 2, 3

_MESSAGE = struct.Struct("<BIQ")
_TIME = struct.Struct("<BQ")
_SERVICE = struct.Struct("<BIII")
_ASSET = struct.Struct("<BIBI")
_STATE = struct.Struct("<BBQfBI")
_DATA = struct.Struct("<BI")
_CONTROL = struct.Struct("<BBfBQI")
_MOST_NS = 2**64 - 1


@dataclass(frozen=True, slots=True)
class ClientData:
    """A message that a client publishes on a channel it advertised."""

    channel_id: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class ServiceCall:
    """A client's call of an advertised service; `call_id` is its choice and comes back with the answer."""

    service_id: int
    call_id: int
    encoding: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class PlaybackControl:
    """What a client wants of the player: `seek_ns` None leaves the place as it is."""

    play: bool
    speed: float
    seek_ns: int | None
    request_id: str


def message_head(subscription_id: int, stamp_ns: int) -> bytes:
    """What stands before the payload of a sample."""
    return _MESSAGE.pack(MESSAGE, subscription_id, _time(stamp_ns))


def time_message(now_ns: int) -> bytes:
    """The server's time."""
    return _TIME.pack(TIME, _time(now_ns))


def service_response(service_id: int, call_id: int, encoding: str, payload: bytes) -> bytes:
    """The answer to a call."""
    name = encoding.encode()
    return _SERVICE.pack(SERVICE_RESPONSE, service_id, call_id, len(name)) + name + payload


def asset_response(request_id: int, data: bytes) -> bytes:
    """A file that was asked for."""
    return _ASSET.pack(ASSET, request_id, 0, 0) + data


def asset_failure(request_id: int, error: str) -> bytes:
    """Why there is no such file."""
    said = error.encode()
    return _ASSET.pack(ASSET, request_id, 1, len(said)) + said


def playback_state(status: int, now_ns: int, speed: float, *, did_seek: bool = False, request_id: str = "") -> bytes:
    """Where the player is; `status` 0 playing, 1 paused, 2 buffering, 3 ended."""
    name = request_id.encode()
    return _STATE.pack(STATE, status, _time(now_ns), speed, did_seek, len(name)) + name


def read_binary(data: bytes) -> ClientData | ServiceCall | PlaybackControl:
    """What a client's binary message says; InvalidRequestError for one that says nothing."""
    if not data:
        raise InvalidRequestError("a binary message begins with its opcode")
    opcode = data[0]
    try:
        if opcode == CLIENT_DATA:
            _, channel_id = _DATA.unpack_from(data)
            return ClientData(channel_id, data[_DATA.size :])
        if opcode == SERVICE_CALL:
            _, service_id, call_id, length = _SERVICE.unpack_from(data)
            encoding, end = _text(data, _SERVICE.size, length)
            return ServiceCall(service_id, call_id, encoding, data[end:])
        if opcode == PLAYBACK:
            return _control(data)
    except (struct.error, UnicodeDecodeError):
        raise InvalidRequestError(f"a message with opcode {opcode} is too short or not readable") from None
    raise InvalidRequestError(f"opcode {opcode} is unknown: a client sends 1, 2 and 3")


def _control(data: bytes) -> PlaybackControl:
    _, command, speed, has_seek, seek_ns, length = _CONTROL.unpack_from(data)
    if command > 1:
        raise InvalidRequestError(f"playback command {command} is unknown: 0 plays, 1 pauses")
    request_id, _ = _text(data, _CONTROL.size, length)
    return PlaybackControl(command == 0, speed, seek_ns if has_seek else None, request_id)


def _text(data: bytes, start: int, length: int) -> tuple[str, int]:
    end = start + length
    if end > len(data):
        raise struct.error
    return data[start:end].decode(), end


def _time(stamp_ns: int) -> int:
    return min(max(0, stamp_ns), _MOST_NS)
