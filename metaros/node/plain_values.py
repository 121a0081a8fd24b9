"""Plain Python values as messages: `create_publisher(str, …)`, and callbacks that get a `str`.

The choice of ROS types is told in docs/adr/0004-plain-payloads.md. The table is the whole of it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import index
from typing import Any, Final

from metaros.cdr import Codec, codec
from metaros.errors import DecodeError, FieldError, UsageError
from metaros.idl import message_class, remember_class
from metaros.node.core import NodeCore
from metaros.node.events.callbacks import PublisherEvents
from metaros.node.publisher import Publisher
from metaros.node.subscription import Subscription
from metaros.wire import QoSProfile

__all__ = ["PLAIN", "PlainPublisher", "ValueCodec", "make_publisher", "make_subscription", "value_codec_of"]


@dataclass(frozen=True, slots=True)
class ValueCodec:
    """How values of one Python type travel: `encode` makes CDR, `decode` gives the value back."""

    codec: Codec
    encode: Callable[[Any], bytes]
    decode: Callable[[bytes], Any]


@dataclass(frozen=True, slots=True)
class _Plain:
    """A row: the ROS type with its one field `data`, and the ways from and to the value in it."""

    type_name: str
    to_data: Callable[[Any], Any]
    from_data: Callable[[Any], Any]


def value_codec_of(message_type: Any) -> ValueCodec:
    """The payload of a message class or of a plain Python type; `UsageError` says what else can be published."""
    row = PLAIN.get(message_type) if isinstance(message_type, type) else None
    if row is None:
        _check(message_type)
        remember_class(message_type)
        code = codec(message_type)
        return ValueCodec(code, code.encode, code.decode)
    return _plain(row)


def _plain(row: _Plain) -> ValueCodec:
    code, cls = codec(row.type_name), message_class(row.type_name)
    pack, unpack, to_data, from_data = code.encode, code.decode, row.to_data, row.from_data

    def encode(value: Any) -> bytes:
        return pack(cls(data=to_data(value)))

    def decode(data: bytes) -> Any:
        return from_data(unpack(data).data)

    return ValueCodec(code, encode, decode)


def _check(message_type: Any) -> None:
    if isinstance(message_type, type) and hasattr(message_type, "__metaros_name__"):
        return
    name = message_type.__qualname__ if isinstance(message_type, type) else repr(message_type)
    plain = ", ".join(kind.__name__ for kind in PLAIN)
    raise UsageError(f"{name} is no message type: decorate the class with @metaros.message, or use one of {plain}")


def _exactly(kind: type[Any]) -> Callable[[Any], Any]:
    def check(value: Any) -> Any:
        if not isinstance(value, kind):
            raise _wrong(value, kind.__name__)
        return value

    return check


def _integer(value: Any) -> int:
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise _wrong(value, "int")
    return index(value)


def _number(value: Any) -> float:
    if isinstance(value, (bool, str)) or not (hasattr(value, "__float__") or hasattr(value, "__index__")):
        raise _wrong(value, "float")
    try:
        return float(value)
    except (OverflowError, TypeError, ValueError) as error:
        raise FieldError(f"no float: {error}") from None


def _bytes(value: Any) -> bytes:
    if not isinstance(value, (bytes, bytearray, memoryview)):
        raise _wrong(value, "bytes")
    return bytes(value)


def _json_from(kind: type[Any]) -> Callable[[Any], str]:
    def dump(value: Any) -> str:
        if not isinstance(value, kind):
            raise _wrong(value, kind.__name__)
        try:
            return json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
        except (TypeError, ValueError, RecursionError) as error:
            raise FieldError(f"the {kind.__name__} cannot be JSON: {error}") from None

    return dump


def _json_to(kind: type[Any]) -> Callable[[str], Any]:
    def load(text: str) -> Any:
        try:
            value = json.loads(text, parse_constant=_no_constant, parse_float=_finite)
        except (ValueError, RecursionError) as error:
            raise DecodeError(f"no JSON: {error}") from None
        if not isinstance(value, kind):
            raise DecodeError(f"JSON of a {type(value).__name__}, where a {kind.__name__} is due")
        return value

    return load


def _no_constant(text: str) -> Any:
    raise ValueError(f"{text} is not in JSON")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:40]} is too large for a float")
    return value


def _wrong(value: Any, wanted: str) -> FieldError:
    return FieldError(f"the topic carries {wanted}, not {type(value).__name__}")


def _same(value: Any) -> Any:
    return value


PLAIN: Final[Mapping[type[Any], _Plain]] = {
    str: _Plain("std_msgs/msg/String", _exactly(str), _same),
    bool: _Plain("std_msgs/msg/Bool", _exactly(bool), _same),
    int: _Plain("std_msgs/msg/Int64", _integer, _same),
    float: _Plain("std_msgs/msg/Float64", _number, _same),
    bytes: _Plain("metaros_msgs/msg/Bytes", _bytes, bytes),
    dict: _Plain("metaros_msgs/msg/Json", _json_from(dict), _json_to(dict)),
    list: _Plain("metaros_msgs/msg/Json", _json_from(list), _json_to(list)),
}


class PlainPublisher(Publisher):
    """Publishes values of one plain type. Bytes are the value here, never CDR."""

    def __init__(
        self,
        node: NodeCore,
        message_type: type[Any],
        topic: str,
        payload: ValueCodec,
        qos: QoSProfile,
        events: PublisherEvents | None = None,
    ) -> None:
        code = payload.codec
        super().__init__(node, message_class(code.name), topic, code, qos, events)
        self.message_type = message_type
        send, encode = self.publish, payload.encode

        def publish(message: Any, *, stamp_ns: int | None = None) -> None:
            send(encode(message), stamp_ns=stamp_ns)

        self.publish = publish


def make_publisher(
    node: NodeCore, message_type: type[Any], topic: str, qos: QoSProfile, events: PublisherEvents | None
) -> Publisher:
    """The publisher of a message class or of a plain type."""
    payload = value_codec_of(message_type)
    if message_type in PLAIN:
        return PlainPublisher(node, message_type, topic, payload, qos, events)
    return Publisher(node, message_type, topic, payload.codec, qos, events)


def make_subscription(
    node: NodeCore,
    message_type: type[Any],
    topic: str,
    callback: Callable[..., Any],
    qos: QoSProfile,
    *,
    raw: bool = False,
    dedicated: bool = False,
    **options: Any,
) -> Subscription:
    """The subscription of a message class or of a plain type."""
    payload = value_codec_of(message_type)
    name, hash_text, decode = payload.codec.name, payload.codec.hash, bytes if raw else payload.decode
    return Subscription(node, topic, name, hash_text, qos, callback, decode=decode, dedicated=dedicated, **options)
