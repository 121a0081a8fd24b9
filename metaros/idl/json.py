"""Messages as JSON-able values and back: for REST, the command line, rules and logs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from metaros.errors import FieldError
from metaros.idl.arrays import DTYPES, as_array
from metaros.idl.catalogue import Catalogue
from metaros.idl.classes import Message, message_class
from metaros.idl.definitions import INTEGER_RANGES, Field, FieldType
from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")

__all__ = ["MAX_LISTED_BYTES", "from_dict", "from_json", "to_json"]

MAX_LISTED_BYTES = 64
_MAX_DEPTH = 64


def to_json(message: Any) -> dict[str, Any]:
    """The fields of `message` as dicts, lists, numbers and texts.

    NaN and infinities become None. A one-byte array of more than 64 elements becomes {"bytes": length}.
    """
    fields = type(message).__metaros_fields__
    return {field.name: _plain(field.type, getattr(message, field.attribute)) for field in fields}


def from_json(name_or_class: str | type[Any], value: Any, catalogue: Catalogue | None = None) -> Any:
    """The message that `value` describes; fields left out have their defaults.

    `FieldError` names the path of what does not fit. None is taken as NaN where a float is due.
    """
    cls = message_class(name_or_class, catalogue) if isinstance(name_or_class, str) else name_or_class
    if not (isinstance(cls, type) and issubclass(cls, Message)):
        raise FieldError(f"{name_or_class!r} is no message type: name the part of the service or action")
    return _message(cls, value, "", 0)


from_dict = from_json


def _plain(kind: FieldType, value: Any) -> Any:
    if kind.array and kind.base in DTYPES:
        return _plain_array(kind, as_array(value, kind.base))
    if kind.array:
        return [_plain(kind.element, item) for item in value]
    if kind.is_nested:
        return to_json(value)
    if kind.is_string:
        return str.__str__(value) if isinstance(value, str) else str(value)  # an enum's text, not its name
    if kind.base == "bool":
        return bool(value)
    if kind.base in INTEGER_RANGES:
        return value[0] if isinstance(value, bytes) else int(value)
    number = float(value)
    return number if math.isfinite(number) else None


def _plain_array(kind: FieldType, values: Any) -> Any:
    if kind.base in ("uint8", "byte", "char", "int8") and values.size > MAX_LISTED_BYTES:
        return {"bytes": int(values.size)}
    listed = values.ravel().tolist()
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        return [item if math.isfinite(item) else None for item in listed]
    return listed


def _message(cls: type[Message], value: Any, path: str, depth: int) -> Any:
    if not isinstance(value, dict):
        raise FieldError(f"{path or 'the message'}: expected an object, got {_kind(value)}")
    if depth > _MAX_DEPTH:
        raise FieldError(f"{path}: nested deeper than {_MAX_DEPTH}")
    known = {field.name: field for field in cls.__metaros_fields__}
    values: dict[str, Any] = {}
    for name, item in value.items():
        where = f"{path}.{name}" if path else str(name)
        field = known.get(name)
        if field is None:
            raise FieldError(f"{where}: {cls.__metaros_name__} has no such field; it has: {', '.join(known) or 'none'}")
        values[field.attribute] = _field(cls, field, item, where, depth)
    return cls(**values)


def _field(cls: type[Message], field: Field, value: Any, path: str, depth: int) -> Any:
    kind = field.type
    if not kind.array:
        return _single(cls, kind, value, path, depth)
    if not isinstance(value, (list, tuple)):
        raise FieldError(f"{path}: expected a list, got {_kind(value)}")
    if kind.array == "fixed" and len(value) != kind.capacity:
        raise FieldError(f"{path}: {len(value)} elements, exactly {kind.capacity} are needed")
    if kind.array == "bounded" and len(value) > kind.capacity:
        raise FieldError(f"{path}: {len(value)} elements, at most {kind.capacity} are allowed")
    items = [_single(cls, kind.element, item, f"{path}[{index}]", depth) for index, item in enumerate(value)]
    return as_array(items, kind.base) if kind.base in DTYPES else items


def _single(cls: type[Message], kind: FieldType, value: Any, path: str, depth: int) -> Any:
    if kind.is_nested:
        return _message(message_class(kind.base, cls.__metaros_catalogue__), value, path, depth + 1)
    if kind.is_string:
        return _text(kind, value, path)
    if kind.base == "bool":
        if isinstance(value, bool):
            return value
    elif kind.base in INTEGER_RANGES:
        return _integer(kind.base, value, path)
    elif value is None:
        return math.nan
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        return _number(kind.base, value, path)
    raise FieldError(f"{path}: expected a {kind.base}, got {_kind(value)}")


def _text(kind: FieldType, value: Any, path: str) -> str:
    if not isinstance(value, str):
        raise FieldError(f"{path}: expected a text, got {_kind(value)}")
    if kind.string_bound and len(value.encode("utf-8", "replace")) > kind.string_bound and kind.base == "string":
        raise FieldError(f"{path}: {len(value)} characters, at most {kind.string_bound} are allowed")
    return value


def _integer(base: str, value: Any, path: str) -> int:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise FieldError(f"{path}: expected a whole number, got {_kind(value)}")
    low, high = INTEGER_RANGES[base]
    if not low <= value <= high:
        raise FieldError(f"{path}: {value} does not fit {base} ({low} to {high})")
    return value


def _number(base: str, value: float, path: str) -> float:
    try:
        number = float(value)
    except OverflowError:
        raise FieldError(f"{path}: {value} does not fit {base}") from None
    if base == "float32" and math.isfinite(number) and abs(number) >= 3.4028235677973366e38:
        raise FieldError(f"{path}: {number} does not fit float32")
    return number


def _kind(value: Any) -> str:
    names = {dict: "an object", list: "a list", str: "a text", bool: "a bool", type(None): "null"}
    return names.get(type(value), f"the number {value!r}" if isinstance(value, (int, float)) else type(value).__name__)
