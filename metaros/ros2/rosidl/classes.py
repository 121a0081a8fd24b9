"""Message, service and action classes as rosidl's Python generator makes them, made of definitions at run time.

A message's fields are its slots: reading one costs what reading a slot costs, where rosidl's properties are calls.
Only sequences and arrays of primitives are properties, which turn what was received into what programs expect.
"""

from __future__ import annotations

import os
from typing import Any

from metaros.idl.catalogue import Catalogue
from metaros.idl.classes import Action, Service, message_class
from metaros.idl.definitions import ActionDefinition, Definition, Field, MessageDefinition, ServiceDefinition
from metaros.idl.hashing import type_hash
from metaros.ros2.rosidl.class_source import default_of, methods
from metaros.ros2.rosidl.held import is_converted, store
from metaros.ros2.rosidl.message import RosidlMessage, become_checked, set_rest
from metaros.ros2.rosidl.meta import Computed, RosidlType, TypeSupport
from metaros.ros2.rosidl.naming import module_name

__all__ = ["make_class"]

_SERVICE_PARTS = ("Request", "Response", "Event")
_ACTION_PARTS = ("Goal", "Result", "Feedback")


def make_class(name: str, catalogue: Catalogue) -> type[Any]:
    """The class of an interface, for a catalogue whose classes have this shape."""
    definition = catalogue.get(name)
    catalogue.dependencies(name)
    if isinstance(definition, MessageDefinition):
        return _make_message(definition, catalogue)
    return _make_namespace(definition, catalogue)


def _identity(name: str, catalogue: Catalogue) -> dict[str, Any]:
    return {
        "__module__": module_name(name, catalogue),
        "__qualname__": name.split("/")[2],
        "__doc__": f"The interface {name}.",
        "__metaros_name__": name,
        "__metaros_hash__": type_hash(name, catalogue),
        "__metaros_catalogue__": catalogue,
    }


def _metaclass(name: str, members: dict[str, Any], fixed: frozenset[str] = frozenset()) -> type[RosidlType]:
    """A metaclass for one class: `_TYPE_SUPPORT` is there, and not shared."""
    own = {
        "__module__": members["__module__"],
        "_support": TypeSupport(name, members["__metaros_hash__"]),
        "_fixed_names": fixed,
    }
    return type(f"Metaclass_{members['__qualname__']}", (RosidlType,), own)


def _make_message(definition: MessageDefinition, catalogue: Catalogue) -> type[Any]:
    fields = definition.fields
    check = os.environ.get("ROS_PYTHON_CHECK_FIELDS") == "1"
    generated, scope = methods(
        fields, catalogue, name=definition.name, check=check, become_checked=become_checked, rest=set_rest
    )
    constants = {item.name: _constant(item.type.base, item.value) for item in definition.constants}
    defaults = {f"{field.name.upper()}__DEFAULT": _default(field, catalogue) for field in fields if _has_default(field)}
    members = {
        **_identity(definition.name, catalogue),
        "__slots__": tuple(f"_{field.name}" for field in fields),
        "__metaros_fields__": fields,
        "_fields_and_field_types": Computed(lambda: _texts(fields), keep="_fields_and_field_types"),
        "SLOT_TYPES": Computed(lambda: _types(fields), keep="SLOT_TYPES"),
        **generated,
        **defaults,
        **constants,
    }
    metaclass = _metaclass(definition.name, members, frozenset((*constants, *defaults)))
    metaclass._is_message = True
    made: type[Any] = metaclass(members["__qualname__"], (RosidlMessage,), members)
    for field in fields:
        _name_slots(made, field)
    type.__setattr__(made, "__slots__", [*members["__slots__"], "_check_fields"])
    scope["_C"] = made
    return made


def _name_slots(cls: Any, field: Field) -> None:
    """The slot by the names that codecs, programs and curious programs know it by."""
    slot = vars(cls)[f"_{field.name}"]
    if is_converted(field.type):
        setattr(cls, store(field), slot)
        setattr(cls, f"_{field.name}", vars(cls)[field.attribute])
    else:
        setattr(cls, field.attribute, slot)
    if field.name != field.attribute:  # a word of Python's: by getattr() and setattr() it can be used all the same
        setattr(cls, field.name, vars(cls)[field.attribute])


def _make_namespace(definition: ServiceDefinition | ActionDefinition, catalogue: Catalogue) -> type[Any]:
    base, parts = (Service, _SERVICE_PARTS) if isinstance(definition, ServiceDefinition) else (Action, _ACTION_PARTS)
    members = _identity(definition.name, catalogue)
    for part in parts:
        members[part] = message_class(f"{definition.name}_{part}", catalogue)
    if base is Action:
        members["Impl"] = _impl(definition, catalogue, members)

    def refuse(self: Any) -> None:
        raise NotImplementedError(f"{definition.name} is made of parts, it has no instances: {', '.join(parts)}")

    members["__init__"] = refuse
    made: type[Any] = _metaclass(definition.name, members)(members["__qualname__"], (base,), members)
    return made


def _impl(definition: Definition, catalogue: Catalogue, members: dict[str, Any]) -> type[Any]:
    """The services and topics that an action consists of."""

    def part(name: str) -> Any:
        full = name if "/" in name else f"{definition.name}_{name}"
        return Computed(lambda: message_class(full, catalogue))

    return type(
        "Impl",
        (),
        {
            "__module__": members["__module__"],
            "__qualname__": f"{members['__qualname__']}.Impl",
            "__doc__": f"What {definition.name} consists of on the wire.",
            "SendGoalService": part("SendGoal"),
            "GetResultService": part("GetResult"),
            "FeedbackMessage": part("FeedbackMessage"),
            "CancelGoalService": part("action_msgs/srv/CancelGoal"),
            "GoalStatusMessage": part("action_msgs/msg/GoalStatusArray"),
        },
    )


def _texts(fields: tuple[Field, ...]) -> dict[str, str]:
    from metaros.ros2.rosidl.slot_types import field_texts

    return field_texts(fields)


def _types(fields: tuple[Field, ...]) -> tuple[Any, ...]:
    from metaros.ros2.rosidl.slot_types import slot_types

    return slot_types(fields)


def _constant(base: str, value: Any) -> Any:
    return bytes((value,)) if base == "byte" else value


def _has_default(field: Field) -> bool:
    return field.default is not None


def _default(field: Field, catalogue: Catalogue) -> Any:
    make = default_of(field.type, field.default, catalogue)
    return Computed(make) if field.type.array else make()
