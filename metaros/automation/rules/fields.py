"""A field of an event by its path: which group an event belongs to, and which value a condition watches."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["ROBOT", "field_at", "group_of_fields", "is_path"]

ROBOT = "robot"  # short for where every event of ours has its robot
_SHORT = {ROBOT: "detail.robot"}
CHARS = 256


def is_path(text: Any) -> bool:
    """Whether it can be the path of a field: names between dots, `$.` before them or not."""
    return isinstance(text, str) and 0 < len(text) <= CHARS and all(text.removeprefix("$.").split("."))


def field_at(event: Mapping[str, Any], path: str) -> Any:
    """The value at a path, or None; a number between dots is a place in a list."""
    value: Any = event
    for name in _SHORT.get(path, path).removeprefix("$.").split("."):
        if isinstance(value, Mapping):
            value = value.get(name)
        elif isinstance(value, list) and name.isdecimal() and len(name) < 10 and int(name) < len(value):
            value = value[int(name)]
        else:
            return None
    return value


def group_of_fields(event: Mapping[str, Any], paths: Sequence[str]) -> str:
    """What tells the event's group from others: at most 256 letters, "" without paths or where the only one is absent.

    Texts, numbers and booleans tell groups apart; an object, a list or null counts as absent.
    """
    values = [field_at(event, path) for path in paths]
    scalars = [value if isinstance(value, str | int | float) else None for value in values]
    if len(scalars) > 1:
        text = json.dumps(scalars, ensure_ascii=False, separators=(",", ":"))
    elif scalars and scalars[0] is not None:
        text = scalars[0] if isinstance(scalars[0], str) else json.dumps(scalars[0])
    else:
        text = ""
    return text if len(text) <= CHARS else hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
