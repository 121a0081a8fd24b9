"""How ROS 2 names its topics and services on DDS: `rt/chatter`, `rq/add_two_intsRequest`, `rr/add_two_intsReply`.

Source: ROS 2's design article "Topic and Service name mapping to DDS", and `facts/ros2_wire.md` §5.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from metaros.errors import NameError_
from metaros.wire.names import check_fqn, dds_name, ros_name

__all__ = ["Kind", "RosName", "dds_topic", "dds_type", "parse_topic", "parse_type"]


class Kind(StrEnum):
    """What a DDS topic carries."""

    TOPIC = "topic"
    REQUEST = "request"
    REPLY = "reply"


_PREFIXES = {Kind.TOPIC: ("rt/", ""), Kind.REQUEST: ("rq/", "Request"), Kind.REPLY: ("rr/", "Reply")}
_HALVES = {Kind.REQUEST: "_Request", Kind.REPLY: "_Response"}


@dataclass(frozen=True, slots=True)
class RosName:
    """A ROS name with its slash, and which of a service's two DDS topics it is, if any."""

    kind: Kind
    name: str


def dds_topic(kind: Kind, name: str) -> str:
    """The DDS topic of a ROS name: ("topic", "/chatter") is "rt/chatter"."""
    prefix, suffix = _PREFIXES[kind]
    return f"{prefix}{name.lstrip('/')}{suffix}"


def parse_topic(topic: str) -> RosName | None:
    """The reverse; None for what is none of ROS's, or no name that ROS allows."""
    for kind, (prefix, suffix) in _PREFIXES.items():
        if topic.startswith(prefix) and topic.endswith(suffix):
            name = topic[len(prefix) : len(topic) - len(suffix)]
            try:
                return RosName(kind, f"/{check_fqn(name)}")
            except NameError_:
                return None
    return None


def parse_type(kind: Kind, spelt: str) -> str:
    """The ROS type of a DDS type name: a message, or the service whose half it is; "" for what is none.

    `std_msgs::msg::dds_::String_` is `std_msgs/msg/String`; `std_srvs::srv::dds_::Trigger_Request_` is
    `std_srvs/srv/Trigger`.
    """
    try:
        name = ros_name(spelt)
    except NameError_:
        return ""
    half = _HALVES.get(kind)
    if half is None:
        return name
    return name.removesuffix(half) if name.endswith(half) else ""


def dds_type(type_name: str) -> str:
    """`std_msgs/msg/String` as cyclonedds' Python spells a DDS type: with dots."""
    return dds_name(type_name).replace("::", ".")
