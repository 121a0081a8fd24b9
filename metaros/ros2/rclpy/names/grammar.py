"""The grammar of ROS names as rclpy's functions tell it: what is wrong, and at which character.

Each `find_*_fault` returns None for a good name. `metaros.idl.names` says the same as one yes or no, a little stricter.
"""

from __future__ import annotations

import re
from typing import Final, NamedTuple

__all__ = [
    "Fault",
    "find_full_name_fault",
    "find_namespace_fault",
    "find_node_name_fault",
    "find_topic_name_fault",
]

LONGEST_TOPIC: Final = 247
LONGEST_NODE: Final = 255
LONGEST_NAMESPACE: Final = 245

_NO_WORD: Final = re.compile(r"[^A-Za-z0-9_]", re.ASCII)
_NO_PATH: Final = re.compile(r"[^A-Za-z0-9_/]", re.ASCII)
_NO_PATTERN: Final = re.compile(r"[^A-Za-z0-9_/~{}]", re.ASCII)
_DIGIT_FIRST: Final = re.compile(r"(?:^|/)[0-9]", re.ASCII)
_SUBSTITUTION: Final = re.compile(r"\{([^{}]*)\}")


class Fault(NamedTuple):
    """What is wrong with a name, and the position of the character."""

    text: str
    position: int


def find_node_name_fault(name: str) -> Fault | None:
    """Of a node's name: one segment."""
    if not name:
        return Fault("node name must not be empty", 0)
    if found := _NO_WORD.search(name):
        return Fault("node name must not contain characters other than letters, digits and '_'", found.start())
    if name[0].isdigit():
        return Fault("node name must not start with a number", 0)
    if len(name) > LONGEST_NODE:
        return Fault(f"node name must not be longer than {LONGEST_NODE} characters", LONGEST_NODE)
    return None


def find_namespace_fault(namespace: str) -> Fault | None:
    """Of a namespace: "/", or an absolute name."""
    if namespace == "/":
        return None
    return _path_fault("namespace", namespace, LONGEST_NAMESPACE)


def find_full_name_fault(name: str) -> Fault | None:
    """Of a topic or service name with nothing left to expand."""
    return _path_fault("topic name", name, LONGEST_TOPIC)


def find_topic_name_fault(name: str) -> Fault | None:
    """Of a topic or service name as programs write it: `a`, `/a`, `~/a`, `{node}/a`."""
    if not name:
        return Fault("topic name must not be empty", 0)
    if name.endswith("/"):
        return Fault("topic name must not end with a '/'", len(name) - 1)
    if found := _NO_PATTERN.search(name):
        text = "topic name must not contain characters other than letters, digits, '_', '/', '~', '{' and '}'"
        return Fault(text, found.start())
    tilde = name.find("~", 1)
    if tilde > 0:
        return Fault("topic name must not have a '~' anywhere but at its start", tilde)
    if len(name) > 1 and name[0] == "~" and name[1] != "/":
        return Fault("topic name must have a '/' after its '~'", 1)
    return _digit_fault("topic name", name) or _substitution_fault(name)


def _path_fault(what: str, name: str, longest: int) -> Fault | None:
    if not name:
        return Fault(f"{what} must not be empty", 0)
    if name[0] != "/":
        return Fault(f"{what} must be absolute, with a '/' first", 0)
    if name.endswith("/"):
        return Fault(f"{what} must not end with a '/'", len(name) - 1)
    if found := _NO_PATH.search(name):
        return Fault(f"{what} must not contain characters other than letters, digits, '_' and '/'", found.start())
    if "//" in name:
        return Fault(f"{what} must not contain two '/' in a row", name.index("//") + 1)
    if len(name) > longest:
        return Fault(f"{what} must not be longer than {longest} characters", longest)
    return _digit_fault(what, name)


def _digit_fault(what: str, name: str) -> Fault | None:
    found = _DIGIT_FIRST.search(name)
    return Fault(f"a token of the {what} must not start with a number", found.end() - 1) if found else None


def _substitution_fault(name: str) -> Fault | None:
    rest = _SUBSTITUTION.sub(lambda match: " " * len(match[0]), name)
    for brace in "{}":
        if brace in rest:
            return Fault("topic name must not have a curly brace without its other half", rest.index(brace))
    for match in _SUBSTITUTION.finditer(name):
        inside = match[1]
        if not inside or _NO_WORD.search(inside):
            return Fault(
                "a substitution must not contain characters other than letters, digits and '_'", match.start(1)
            )
        if inside[0].isdigit():
            return Fault("a substitution must not start with a number", match.start(1))
    return None
