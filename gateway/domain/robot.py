"""A robot: one agent identity with one link, and the rules its self-description has to keep."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

__all__ = ["Robot", "is_robot_id"]

_ROBOT_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True, slots=True)
class Robot:
    """What a robot says about itself in its Hello."""

    id: str
    namespace: str = "/"
    hostname: str = ""
    agent_version: str = ""
    labels: Mapping[str, str] = field(default_factory=dict)


def is_robot_id(text: str) -> bool:
    """True for 1 to 64 characters of letters, digits, `_`, `.` and `-` that start with a letter or digit."""
    return _ROBOT_ID.fullmatch(text) is not None
