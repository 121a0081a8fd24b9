"""`rclpy.serialization`: messages as CDR bytes and back."""

from __future__ import annotations

from typing import Any

from metaros.cdr import codec
from metaros.errors import DecodeError
from metaros.ros2.rclpy.core.rcl_errors import RMWError
from metaros.ros2.rclpy.names.type_support import check_for_type_support

__all__ = ["deserialize_message", "serialize_message"]


def serialize_message(message: Any) -> bytes:
    """The message in CDR, as it goes over the wire.

    Raises:
        AttributeError: it is no message.
        FieldError: a field's value does not fit.
    """
    check_for_type_support(type(message))
    return codec(type(message)).encode(message)


def deserialize_message(serialized_message: bytes, message_type: type[Any]) -> Any:
    """The message of that type that the bytes hold.

    Raises:
        AttributeError: it is no type of messages.
        RMWError: they hold none.
    """
    check_for_type_support(message_type)
    try:
        return codec(message_type).decode(bytes(serialized_message))
    except DecodeError as error:
        raise RMWError(f"failed to deserialize a {message_type.__name__}: {error}") from error
