"""`rclpy.expand_topic_name`: from a name as a program writes it to the one in the graph, before remapping."""

from __future__ import annotations

import re
from typing import Final

from metaros.ros2.rclpy.names.grammar import find_namespace_fault, find_node_name_fault, find_topic_name_fault

__all__ = ["expand_topic_name"]

_SUBSTITUTION: Final = re.compile(r"\{([^{}]*)\}")


def expand_topic_name(topic_name: str, node_name: str, node_namespace: str) -> str:
    """The full name that `topic_name` means on that node; ValueError where one of the three is none.

    `~` is the node, `{node}` its name, `{ns}` and `{namespace}` its namespace.
    """
    for what, name, fault in (
        ("topic name", topic_name, find_topic_name_fault(topic_name)),
        ("node name", node_name, find_node_name_fault(node_name)),
        ("namespace", node_namespace, find_namespace_fault(node_namespace)),
    ):
        if fault is not None:
            raise ValueError(f"{what} {name!r} is invalid: {fault.text}")
    prefix = node_namespace.rstrip("/")
    known = {"node": node_name, "ns": node_namespace, "namespace": node_namespace}

    def substitute(match: re.Match[str]) -> str:
        if match[1] not in known:
            raise ValueError(f"unknown substitution {match[0]} in {topic_name!r}: there are {{node}} and {{ns}}")
        return known[match[1]]

    name = topic_name
    if name.startswith("~"):
        name = f"{prefix}/{node_name}{name[1:]}"
    name = _SUBSTITUTION.sub(substitute, name)
    return name if name.startswith("/") else f"{prefix}/{name}"
