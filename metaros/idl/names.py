"""The grammar of ROS names: topics, services, nodes and namespaces."""

from __future__ import annotations

import re

from metaros.errors import NameError_
from metaros.limits import LIMITS

__all__ = ["resolve", "validate_namespace", "validate_node", "validate_topic"]

_SEGMENT = r"[A-Za-z_][A-Za-z0-9_]*"
_NODE = re.compile(rf"{_SEGMENT}\Z")
_NAMESPACE = re.compile(rf"/(?:{_SEGMENT}(?:/{_SEGMENT})*)?\Z")
_TOPIC = re.compile(rf"(?:/|~/)?{_SEGMENT}(?:/{_SEGMENT})*\Z|~\Z")
_RULE = "segments of letters, digits and _, none starting with a digit, joined by single /"


def validate_topic(name: str) -> str:
    """Return `name` if it may name a topic or service: absolute, relative, or private with `~/`."""
    _check(name, "topic or service name")
    if not _TOPIC.match(name) or "__" in name:
        raise NameError_(f"{name!r} is no topic or service name: {_RULE}, no double _")
    return name


def validate_node(name: str) -> str:
    """Return `name` if it may name a node: one segment."""
    _check(name, "node name")
    if not _NODE.match(name):
        raise NameError_(f"{name!r} is no node name: letters, digits and _, not starting with a digit")
    return name


def validate_namespace(namespace: str) -> str:
    """Return `namespace` if it is one: "/" or an absolute name."""
    _check(namespace, "namespace")
    if not _NAMESPACE.match(namespace) or "__" in namespace:
        raise NameError_(f"{namespace!r} is no namespace: / followed by {_RULE}, no double _")
    return namespace


def resolve(name: str, namespace: str = "/", node: str = "n") -> str:
    """The full name of `name` as the node called `node` in `namespace` means it."""
    validate_topic(name)
    validate_namespace(namespace)
    validate_node(node)
    prefix = namespace.rstrip("/")
    if name.startswith("/"):
        full = name
    elif name.startswith("~"):
        full = f"{prefix}/{node}{name[1:]}"
    else:
        full = f"{prefix}/{name}"
    _check(full, "topic or service name")
    return full


def _check(name: object, what: str) -> None:
    if not isinstance(name, str) or not name:
        raise NameError_(f"a {what} is a text of at least one character, not {name!r}")
    if len(name) > LIMITS.ros_name_chars:
        raise NameError_(
            f"the {what} {name[:40]}… has {len(name)} characters, at most {LIMITS.ros_name_chars} are allowed"
        )
