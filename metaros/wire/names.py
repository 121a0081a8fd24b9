"""How ROS names and types are spelt on the wire: `std_msgs/msg/String` is `std_msgs::msg::dds_::String_`."""

from __future__ import annotations

import re

from metaros.errors import NameError_
from metaros.limits import LIMITS

__all__ = ["NO_HASH", "check_fqn", "check_hash", "dds_name", "mangle", "ros_name", "unmangle"]

NO_HASH = "TypeHashNotSupported"  # what ROS 2 Humble writes where later releases write RIHS01_…

# `~` and `{}` never reach the wire: names are expanded before. Leading digits are illegal in every part.
_FQN = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*", re.ASCII)
_TYPE = re.compile(r"([A-Za-z][A-Za-z0-9_]*)/(msg|srv|action)/([A-Za-z][A-Za-z0-9_]*)", re.ASCII)
_DDS = re.compile(r"([A-Za-z][A-Za-z0-9_]*)::(msg|srv|action)::dds_::([A-Za-z][A-Za-z0-9_]*)_", re.ASCII)
_HASH = re.compile(r"RIHS01_[A-Za-z0-9]+", re.ASCII)  # the digest's length is the type's own affair


def check_fqn(name: str) -> str:
    """Return `name` without its leading slash; NameError_ unless it is a full topic or service name."""
    if len(name) > LIMITS.ros_name_chars:
        raise NameError_(f"name of {len(name)} characters is longer than the limit of {LIMITS.ros_name_chars}")
    if _FQN.fullmatch(name) is None:
        raise NameError_(f"{name!r} is no ROS name: parts of letters, digits and _, joined by single slashes")
    return name.removeprefix("/")


def check_hash(type_hash: str) -> str:
    """Return `type_hash` if it may stand in a key; NameError_ otherwise."""
    if type_hash != NO_HASH and _HASH.fullmatch(type_hash) is None:
        raise NameError_(f"{type_hash!r} is no type hash: RIHS01_<hex> or {NO_HASH}")
    return type_hash


def dds_name(type_name: str) -> str:
    """`pkg/msg/Name` as it stands in keys and tokens."""
    match = _TYPE.fullmatch(type_name)
    if match is None:
        raise NameError_(f"{type_name!r} is no interface name such as std_msgs/msg/String")
    return f"{match[1]}::{match[2]}::dds_::{match[3]}_"


def ros_name(dds: str) -> str:
    """The reverse of `dds_name`."""
    match = _DDS.fullmatch(dds)
    if match is None:
        raise NameError_(f"{dds!r} is no type on the wire such as std_msgs::msg::dds_::String_")
    return f"{match[1]}/{match[2]}/{match[3]}"


def mangle(name: str) -> str:
    """A name as one token part: every slash becomes `%`; the root namespace is `%` alone."""
    return name.replace("/", "%")


def unmangle(part: str) -> str:
    """The reverse of `mangle`."""
    return part.replace("%", "/")
