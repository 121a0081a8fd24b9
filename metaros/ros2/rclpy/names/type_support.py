"""`rclpy.type_support`: whether a class is a message or a service that can be encoded."""

from __future__ import annotations

from typing import Any, TypeVar

from metaros.ros2.rclpy.names.exceptions import NoTypeSupportImportedException

__all__ = [
    "Action",
    "Msg",
    "MsgT",
    "Srv",
    "SrvEventT",
    "SrvRequestT",
    "SrvResponseT",
    "SrvT",
    "check_for_type_support",
    "check_is_valid_action_type",
    "check_is_valid_msg_type",
    "check_is_valid_srv_type",
]

# Names that annotations use. A class of an interface is known by what rosidl's generator gives it, not by its bases.
Msg = Any
Srv = Any
Action = Any
MsgT = TypeVar("MsgT")
SrvT = TypeVar("SrvT")
SrvRequestT = TypeVar("SrvRequestT")
SrvResponseT = TypeVar("SrvResponseT")
SrvEventT = TypeVar("SrvEventT")


def check_for_type_support(msg_or_srv_type: Any) -> None:
    """Load what encodes the type.

    Raises:
        AttributeError: it is no interface of ROS 2.
        NoTypeSupportImportedException: it looks like one, and nothing encodes it.
    """
    try:
        support = msg_or_srv_type._TYPE_SUPPORT
    except AttributeError as error:
        text = f"{msg_or_srv_type!r} is no message or service of ROS 2: give a class such as std_msgs.msg.String"
        raise AttributeError(f"{error}. {text}", name=error.name, obj=error.obj) from None
    if support is None:
        msg_or_srv_type.__import_type_support__()
        if msg_or_srv_type._TYPE_SUPPORT is None:
            raise NoTypeSupportImportedException


def check_is_valid_msg_type(msg_type: Any) -> None:
    """RuntimeError where it is a service or an action; otherwise as `check_for_type_support`."""
    check_for_type_support(msg_type)
    _require(msg_type, ("get_fields_and_field_types", "SLOT_TYPES"), "message")


def check_is_valid_srv_type(srv_type: Any) -> None:
    """RuntimeError where it is a message or an action; otherwise as `check_for_type_support`."""
    check_for_type_support(srv_type)
    _require(srv_type, ("Request", "Response"), "service")


def check_is_valid_action_type(action_type: Any) -> None:
    """RuntimeError where it is a message or a service; otherwise as `check_for_type_support`."""
    check_for_type_support(action_type)
    _require(action_type, ("Goal", "Result", "Feedback"), "action")


def _require(interface: Any, attributes: tuple[str, ...], what: str) -> None:
    if any(_found(interface, name) is None for name in attributes):
        raise RuntimeError(f"The {what} type provided is not valid: {interface!r} is no {what}, it is something else")


def _found(interface: Any, name: str) -> Any:
    """The attribute, unread: `SLOT_TYPES` is made when somebody reads it."""
    for kind in getattr(interface, "__mro__", ()):
        if name in vars(kind):
            return vars(kind)[name]
    return getattr(interface, name, None)
