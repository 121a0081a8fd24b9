"""`rosidl_runtime_py.set_message`: messages filled from dicts, as `ros2 topic pub` fills them from YAML."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from metaros.idl.classes import message_class
from metaros.ros2.rosidl.parser.definition import AbstractNestedType, BasicType, NamespacedType
from metaros.ros2.rosidl.runtime.convert import get_message_slot_types
from metaros.ros2.rosidl.runtime.import_message import import_message_from_namespaced_type

__all__ = ["set_message_fields"]

_HEADER, _TIME = "std_msgs.msg._header.Header", "builtin_interfaces.msg._time.Time"
Setter = Callable[[Any], None]


def set_message_fields(
    msg: Any, values: Mapping[str, Any], expand_header_auto: bool = False, expand_time_now: bool = False
) -> list[Setter]:
    """Set the fields that `values` has; what it does not have stays.

    With `expand_header_auto` the text "auto" stands for a header, with `expand_time_now` "now" for a time: each adds a
    function to the list that is returned, which sets that time when it is called with it. AttributeError for what is no
    field, TypeError or ValueError for a value that does not fit.
    """
    setters: list[Setter] = []
    _fill(msg, values, setters, auto=expand_header_auto, now=expand_time_now)
    return setters


def _fill(msg: Any, values: Any, setters: list[Setter], *, auto: bool, now: bool) -> None:
    if not hasattr(values, "items"):
        raise TypeError(f"Value '{values}' is expected to be a dictionary but is a {type(values).__name__}")
    kinds = get_message_slot_types(msg)
    for name, value in values.items():
        present, kind = getattr(msg, name), kinds.get(name)
        place = f"{type(present).__module__}.{type(present).__name__}"
        if place == _HEADER and auto and value == "auto":
            setters.append(partial(setattr, present, "stamp"))
        elif place == _TIME and now and value == "now":
            setters.append(partial(setattr, msg, name))
        elif isinstance(kind, AbstractNestedType) and isinstance(kind.value_type, NamespacedType):
            element = _class_of(msg, kind.value_type)
            setattr(msg, name, [_message(element, item, setters, auto=auto, now=now) for item in value])
        elif isinstance(kind, NamespacedType):
            setattr(msg, name, _message(type(present), value, setters, auto=auto, now=now))
        else:
            setattr(msg, name, _value(present, value, kind))


def _message(cls: Any, value: Any, setters: list[Setter], *, auto: bool, now: bool) -> Any:
    """A message of `cls`: the given one, or a new one with the given fields."""
    if isinstance(value, cls):
        return value
    made = cls()
    _fill(made, value, setters, auto=auto, now=now)
    return made


def _value(present: Any, value: Any, kind: Any) -> Any:
    """What the field takes, of the type that it has."""
    octets = (kind.value_type if isinstance(kind, AbstractNestedType) else kind) == BasicType("octet")
    if isinstance(present, array):
        return array(present.typecode, value)
    if hasattr(present, "dtype"):
        return _numbers(present, value)
    if octets and isinstance(kind, AbstractNestedType):
        return [bytes((item,)) if isinstance(item, int) else item for item in value]
    if octets and isinstance(value, int):
        return bytes((value,))
    return value if type(value) is type(present) else type(present)(value)


def _numbers(present: Any, value: Any) -> Any:
    import numpy as np

    return np.array(value, dtype=present.dtype)


def _class_of(msg: Any, kind: NamespacedType) -> Any:
    catalogue = getattr(type(msg), "__metaros_catalogue__", None)
    if catalogue is None:
        return import_message_from_namespaced_type(kind)
    return message_class("/".join(kind.namespaced_name()), catalogue)
