"""CDR to and from the values of rosbridge clients, by the types that robots announced."""

from __future__ import annotations

import threading
from typing import Any

from gateway.api.rosbridge.from_message import json_values
from gateway.api.rosbridge.to_message import arguments, message_of
from gateway.domain.channel import Channel
from gateway.domain.decoder import Decoder
from gateway.errors import InvalidRequestError
from metaros.cdr import codec
from metaros.cdr.layout import check_size, least_bytes
from metaros.errors import MetarosError, TooLargeError
from metaros.idl import Catalogue, message_class
from metaros.limits import LIMITS

__all__ = ["decode", "decoded", "encode", "fault_of", "types_of"]

LARGEST_SENT = LIMITS.frame_bytes // 2
_local = threading.local()  # samples are decoded on the loop and in a thread


def types_of(channel: Channel) -> Catalogue:
    """Where a channel's type is defined.

    Raises:
        SealedError: nobody but the holder of its key can read it.
        UnknownTypeError, TypeHashError: its robot did not tell the definition.
    """
    return _decoder().types_of(channel)


def fault_of(channel: Channel) -> str:
    """Why nothing of a channel can be shown as values; "" where it can."""
    try:
        check_size(channel.schema_name, types_of(channel))
    except MetarosError as error:
        return str(error)
    return ""


def decoded(channel: Channel, payload: bytes | memoryview) -> Any:
    """A sample's message; MetarosError where it is none, or too large to be shown."""
    if len(payload) > LIMITS.rosbridge_message_bytes:
        raise TooLargeError(f"{len(payload)} bytes are not shown, at most {LIMITS.rosbridge_message_bytes}")
    return _decoder().reader(channel)(payload)


def encode(name: str, value: Any, catalogue: Catalogue, *, now_ns: int) -> bytes:
    """CDR of what a client said: an object, or a list of the fields' values; FieldError names what does not fit."""
    check_size(name, catalogue)
    if least_bytes(name, catalogue) > LIMITS.frame_bytes:  # a robot may tell what it likes
        raise InvalidRequestError(f"every message of type {name[:80]} is too large to be sent")
    cls = message_class(name, catalogue)
    payload = codec(name, catalogue).encode(message_of(cls, arguments(cls, value), now_ns=now_ns))
    if len(payload) > LARGEST_SENT:
        raise InvalidRequestError(f"the message has {len(payload)} bytes, at most {LARGEST_SENT} may go")
    return payload


def decode(name: str, payload: bytes, catalogue: Catalogue) -> dict[str, Any]:
    """CDR as values for `json_bytes`; DecodeError when it is none of that type."""
    return json_values(codec(name, catalogue).decode(payload))


def _decoder() -> Decoder:
    decoder: Decoder | None = getattr(_local, "decoder", None)
    if decoder is None:
        decoder = _local.decoder = Decoder()
    return decoder
