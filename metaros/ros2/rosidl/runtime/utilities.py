"""`rosidl_runtime_py.utilities`: classes by name, and what a class is."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rosidl.parser.definition import NamespacedType
from metaros.ros2.rosidl.runtime.import_message import import_message_from_namespaced_type

__all__ = [
    "get_action",
    "get_action_namespaced_type",
    "get_interface",
    "get_message",
    "get_message_namespaced_type",
    "get_namespaced_type",
    "get_service",
    "get_service_namespaced_type",
    "is_action",
    "is_message",
    "is_service",
]


def get_namespaced_type(path: str) -> NamespacedType:
    """The `NamespacedType` of a full name such as "std_msgs/msg/String"."""
    return _namespaced(path, "")


def get_message_namespaced_type(path: str) -> NamespacedType:
    """The same of a message; "std_msgs/String" will do."""
    return _namespaced(path, "msg")


def get_service_namespaced_type(path: str) -> NamespacedType:
    """The same of a service."""
    return _namespaced(path, "srv")


def get_action_namespaced_type(path: str) -> NamespacedType:
    """The same of an action."""
    return _namespaced(path, "action")


def is_message(interface: Any) -> bool:
    """Whether it is a message class."""
    return hasattr(interface, "SLOT_TYPES")


def is_service(interface: Any) -> bool:
    """Whether it is a service class."""
    return hasattr(interface, "Request") and hasattr(interface, "Response")


def is_action(interface: Any) -> bool:
    """Whether it is an action class."""
    return all(hasattr(interface, part) for part in ("Goal", "Result", "Feedback"))


def get_message(identifier: str) -> Any:
    """The message class of that name; ValueError if it is the name of something else."""
    found = import_message_from_namespaced_type(get_message_namespaced_type(identifier))
    return _expected(found, is_message(found), "a message", identifier)


def get_service(identifier: str) -> Any:
    """The service class of that name; ValueError if it is the name of something else."""
    found = import_message_from_namespaced_type(get_service_namespaced_type(identifier))
    return _expected(found, is_service(found), "a service", identifier)


def get_action(identifier: str) -> Any:
    """The action class of that name; ValueError if it is the name of something else."""
    found = import_message_from_namespaced_type(get_action_namespaced_type(identifier))
    return _expected(found, is_action(found), "an action", identifier)


def get_interface(identifier: str) -> Any:
    """The class of that full name, of whatever kind."""
    found = import_message_from_namespaced_type(get_namespaced_type(identifier))
    good = is_message(found) or is_service(found) or is_action(found)
    return _expected(found, good, "a message, a service or an action", identifier)


def _expected(found: Any, good: bool, what: str, identifier: str) -> Any:
    if not good:
        raise ValueError(f"Expected the full name of {what}, got {identifier!r}")
    return found


def _namespaced(path: str, default: str) -> NamespacedType:
    *namespaces, name = path.split("/")
    if len(namespaces) == 1 and default:
        namespaces.append(default)
    if not all((name, *namespaces)) or len(namespaces) < 2:
        raise ValueError(f"Expected a full name such as 'std_msgs/msg/String', got {path!r}")
    return NamespacedType(namespaces, name)
