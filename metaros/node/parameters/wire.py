"""Parameters as rcl_interfaces messages, both ways."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.rcl_interfaces.msg import FloatingPointRange, IntegerRange, Parameter, ParameterEvent
from metaros.interfaces.rcl_interfaces.msg import ParameterDescriptor as DescriptorMessage
from metaros.interfaces.rcl_interfaces.msg import ParameterValue as ValueMessage
from metaros.node.parameters.descriptor import ParameterDescriptor, Range
from metaros.node.parameters.store import Change, Entry
from metaros.node.parameters.values import ParameterType, Value, kind_of

__all__ = ["descriptor_message", "event_message", "parameter_message", "read_descriptor", "read_value", "value_message"]

_FIELDS: Final = {
    ParameterType.BOOL: "bool_value",
    ParameterType.INTEGER: "integer_value",
    ParameterType.DOUBLE: "double_value",
    ParameterType.STRING: "string_value",
    ParameterType.BYTE_ARRAY: "byte_array_value",
    ParameterType.BOOL_ARRAY: "bool_array_value",
    ParameterType.INTEGER_ARRAY: "integer_array_value",
    ParameterType.DOUBLE_ARRAY: "double_array_value",
    ParameterType.STRING_ARRAY: "string_array_value",
}


def value_message(value: Value, kind: ParameterType | None = None) -> ValueMessage:
    """The value, typed as `kind` where an empty list does not tell its type."""
    kind = kind_of(value) if kind is None or value is None else kind
    if kind is ParameterType.NOT_SET:
        return ValueMessage()
    fields: dict[str, Any] = {_FIELDS[kind]: value}
    return ValueMessage(type=int(kind), **fields)


def read_value(message: ValueMessage) -> Value:
    """The value inside; None where it is not set or of a type that no release knows."""
    try:
        kind = ParameterType(message.type)
    except ValueError:
        return None
    if kind is ParameterType.NOT_SET:
        return None
    value: Any = getattr(message, _FIELDS[kind])
    if kind is ParameterType.BYTE_ARRAY:
        return bytes(value)
    if hasattr(value, "tolist"):
        value = value.tolist()
    return list(value) if isinstance(value, list | tuple) else value


def parameter_message(name: str, value: Value, kind: ParameterType | None = None) -> Parameter:
    """A named value."""
    return Parameter(name=name, value=value_message(value, kind))


def descriptor_message(entry: Entry | None) -> DescriptorMessage:
    """The type and rules of a declared parameter; the empty descriptor without one."""
    if entry is None:
        return DescriptorMessage()
    descriptor, kind = entry.descriptor, entry.kind or entry.descriptor.kind
    message = DescriptorMessage(
        name=descriptor.name,
        type=int(kind),
        description=descriptor.description,
        additional_constraints=descriptor.words,
        read_only=descriptor.read_only,
        dynamic_typing=descriptor.dynamic_typing,
    )
    bounds = descriptor.range
    if bounds is not None and descriptor.kind is ParameterType.INTEGER:
        fields = {"from_value": int(bounds.low), "to_value": int(bounds.high), "step": int(bounds.step)}
        message.integer_range = [IntegerRange(**fields)]
    elif bounds is not None:
        message.floating_point_range = [
            FloatingPointRange(from_value=float(bounds.low), to_value=float(bounds.high), step=float(bounds.step))
        ]
    return message


def read_descriptor(message: DescriptorMessage) -> ParameterDescriptor | None:
    """A remote parameter's rules; None for the empty descriptor of an unknown one."""
    if not message.name or message.type not in ParameterType.__members__.values():
        return None
    kind = ParameterType(message.type)
    ranges: list[Any] = [*message.integer_range, *message.floating_point_range]
    bounds = Range(ranges[0].from_value, ranges[0].to_value, ranges[0].step) if ranges else None
    return ParameterDescriptor(
        name=message.name,
        kind=kind,
        description=message.description,
        constraints=message.additional_constraints,
        read_only=message.read_only,
        dynamic_typing=message.dynamic_typing or kind is ParameterType.NOT_SET,
        range=bounds if kind in (ParameterType.INTEGER, ParameterType.DOUBLE) else None,
    )


def event_message(node: str, changes: Iterable[Change], stamp_ns: int) -> ParameterEvent:
    """What happened to a node's parameters, as /parameter_events tells it."""
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    event = ParameterEvent(stamp=Time(sec=seconds, nanosec=nanoseconds), node=node)
    lists: dict[str, list[Parameter]] = {"new": [], "changed": [], "deleted": []}
    for change in changes:
        lists[change.what].append(parameter_message(change.name, change.value, change.kind))
    event.new_parameters, event.changed_parameters = lists["new"], lists["changed"]
    event.deleted_parameters = lists["deleted"]
    return event
