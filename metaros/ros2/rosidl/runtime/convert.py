"""`rosidl_runtime_py.convert`: messages as ordered dicts, YAML and comma-separated values, as `ros2 topic echo` does.

`truncate_length` cuts texts and arrays, not fields; `no_arr` and `no_str` give lengths instead of contents.
"""

from __future__ import annotations

import sys
from array import array
from collections import OrderedDict
from typing import Any

from metaros.ros2.rosidl.parser import definition as parser

__all__ = ["get_message_slot_types", "message_to_csv", "message_to_ordereddict", "message_to_yaml"]


def message_to_ordereddict(
    msg: Any, *, truncate_length: int | None = None, no_arr: bool = False, no_str: bool = False
) -> OrderedDict[str, Any]:
    """The fields in order; messages within are dicts too, arrays lists, octets texts. Bytes are {"bytes": …}."""
    if isinstance(msg, bytes):
        return OrderedDict(bytes=msg)
    return OrderedDict(
        (name, _convert_value(value, kind, truncate_length, no_arr, no_str)) for name, kind, value in _fields(msg)
    )


def message_to_yaml(
    msg: Any,
    *,
    truncate_length: int | None = None,
    no_arr: bool = False,
    no_str: bool = False,
    flow_style: bool = False,
) -> str:
    """The message as a YAML mapping, with `flow_style` in one line."""
    import yaml

    values = message_to_ordereddict(msg, truncate_length=truncate_length, no_arr=no_arr, no_str=no_str)
    return yaml.dump(
        _plain(values), allow_unicode=True, width=sys.maxsize, default_flow_style=flow_style, sort_keys=False
    )


def message_to_csv(msg: Any, *, truncate_length: int | None = None, no_arr: bool = False, no_str: bool = False) -> str:
    """All values of the message, those of arrays and messages within included, with commas between them."""
    if isinstance(msg, bytes):
        return str(msg)
    return ",".join(_csv(value, kind, truncate_length, no_arr, no_str) for _, kind, value in _fields(msg))


def get_message_slot_types(msg: Any) -> OrderedDict[str, Any]:
    """The types of the fields by name, as `rosidl_parser.definition` has them."""
    return OrderedDict(zip(msg.get_fields_and_field_types(), _slot_types(msg), strict=False))


def _slot_types(msg: Any) -> Any:
    """Of any message: native classes say the same in other words."""
    from metaros.ros2.rosidl.slot_types import slot_types

    return msg.SLOT_TYPES if hasattr(msg, "SLOT_TYPES") else slot_types(msg.__metaros_fields__)


def _fields(msg: Any) -> list[tuple[str, Any, Any]]:
    attributes = {field.name: field.attribute for field in getattr(msg, "__metaros_fields__", ())}
    kinds = get_message_slot_types(msg).items()
    return [(name, kind, getattr(msg, attributes.get(name, name))) for name, kind in kinds]


def _is_array(value: Any) -> bool:
    return isinstance(value, (list, tuple, array)) or getattr(value, "ndim", 0) > 0


def _convert_value(
    value: Any,
    field_type: Any = None,
    truncate_length: int | None = None,
    no_arr: bool = False,
    no_str: bool = False,
) -> Any:
    options = (truncate_length, no_arr, no_str)
    if isinstance(value, (bool, int, float)):
        return value
    if isinstance(value, bytes):
        return _cut(value.decode("latin-1"), truncate_length)
    if isinstance(value, str):
        return f"<string length: <{len(value)}>>" if no_str else _cut(value, truncate_length)
    if isinstance(value, dict):
        return type(value)((_convert_value(key), _convert_value(item, None, *options)) for key, item in value.items())
    if not _is_array(value):
        return value.item() if hasattr(value, "dtype") else message_to_ordereddict(value, **_named(*options))
    if no_arr and field_type is not None:
        return _summary(value, field_type)
    whole = truncate_length is None or len(value) <= truncate_length
    items = [_convert_value(item, None, *options) for item in (value if whole else value[:truncate_length])]
    return (tuple if isinstance(value, tuple) else list)(items if whole else [*items, "..."])


def _csv(value: Any, field_type: Any, truncate_length: int | None, no_arr: bool, no_str: bool) -> str:
    options = (truncate_length, no_arr, no_str)
    if _is_array(value):
        if no_arr and field_type is not None:
            return _summary(value, field_type)
        whole = truncate_length is None or len(value) <= truncate_length
        parts = [_csv(item, None, *options) for item in (value if whole else value[:truncate_length])]
        return ",".join(parts if whole else [*parts, "..."])
    if isinstance(value, str):
        return f"<string length: <{len(value)}>>" if no_str else _cut(value, truncate_length)
    if isinstance(value, bytes):
        cut = truncate_length is not None and len(value) > truncate_length
        return str(value[:truncate_length] + b"..." if cut else value)
    if isinstance(value, (bool, int, float)) or hasattr(value, "dtype"):
        return str(value)
    return message_to_csv(value, **_named(*options))


def _named(truncate_length: int | None, no_arr: bool, no_str: bool) -> dict[str, Any]:
    return {"truncate_length": truncate_length, "no_arr": no_arr, "no_str": no_str}


def _cut(text: str, length: int | None) -> str:
    return text if length is None or len(text) <= length else f"{text[:length]}..."


def _summary(value: Any, kind: Any) -> str:
    name = _type_name(kind.value_type)
    if isinstance(kind, parser.Array):
        return f"<array type: {name}[{kind.size}]>"
    bound = f"[{kind.maximum_size}]" if isinstance(kind, parser.BoundedSequence) else ""
    return f"<sequence type: {name}{bound}, length: {len(value)}>"


def _type_name(kind: Any) -> str:
    if isinstance(kind, parser.BasicType):
        return kind.typename
    if isinstance(kind, parser.NamespacedType):
        return "/".join(kind.namespaced_name())
    return "wstring" if isinstance(kind, parser.AbstractWString) else "string"


def _plain(value: Any) -> Any:
    """The same of dicts and lists alone, which YAML knows."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, (list, tuple)) else value
