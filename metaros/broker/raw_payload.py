"""Text, JSON and bytes: the three types whose only field `data` is the payload itself, or nearly. Pure."""

from __future__ import annotations

import json
import math
from typing import Any

from metaros.broker.type_inference import BYTES, JSON, TEXT, TYPE_MARKER
from metaros.errors import FieldError

__all__ = ["raw_data", "raw_payload"]


def raw_data(type_name: str, value: Any, payload: bytes) -> bytes | str | None:
    """What `data` of such a type is, for a payload and its parsed `value`; None where fields are to be converted.

    A String takes any text, `{"data": "text"}` for its own; Json any JSON; Bytes the payload as it is.
    """
    if type_name == BYTES:
        return payload
    if type_name == JSON:
        return _json_text(value)
    return _text(value, payload) if type_name == TEXT and not _is_wrapped_text(value) else None


def raw_payload(message: Any) -> bytes | None:
    """The reverse: JSON and bytes go out as they are; None for every other message."""
    name = message.__metaros_name__
    if name == BYTES:
        return bytes(message.data)
    if name == JSON:
        try:
            json.loads(message.data)
        except (ValueError, RecursionError):
            raise FieldError("data: no JSON in a Json message") from None
        return str(message.data).encode()
    return None


def _is_wrapped_text(value: Any) -> bool:
    return isinstance(value, dict) and isinstance(value.get("data"), str) and value.keys() <= {"data", TYPE_MARKER}


def _text(value: Any, payload: bytes) -> str:
    if isinstance(value, bytes):
        raise FieldError("bytes that are no UTF-8 text for a String")
    return value if isinstance(value, str) else payload.decode()


def _json_text(value: Any) -> str:
    if isinstance(value, bytes):
        raise FieldError("bytes that are no UTF-8 text for a Json")
    try:
        return json.dumps(value, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(value))


def _finite(value: Any) -> Any:
    """JSON has no NaN and no infinities, though Python writes them."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {name: _finite(item) for name, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list) else value
