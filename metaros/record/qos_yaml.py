"""QoS profiles as rosbag2 writes them into its files: YAML, one entry a publisher, names for the policies."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any, TypeVar

import yaml

from metaros.errors import FieldError
from metaros.limits import LIMITS
from metaros.wire import INFINITE_NS, Durability, History, Liveliness, QoSProfile, Reliability

__all__ = ["offered_qos", "qos_entries", "read_qos"]

_SECOND_NS = 1_000_000_000
_MOST_BRACKETS = 1024
_E = TypeVar("_E", bound=IntEnum)


def qos_entries(profiles: Sequence[QoSProfile]) -> list[dict[str, Any]]:
    """The profiles as rosbag2's metadata holds them."""
    return [_entry(profile.resolved()) for profile in profiles]


def offered_qos(profiles: Sequence[QoSProfile]) -> str:
    """The text of a channel's `offered_qos_profiles`."""
    return yaml.safe_dump(qos_entries(profiles), sort_keys=False).strip() if profiles else ""


def read_qos(text: str) -> list[QoSProfile]:
    """The profiles in such a text, written by any release of rosbag2; what cannot be read is left out."""
    if len(text) > LIMITS.offered_qos_chars or "<<" in text:  # merged again and again, a few lines fill the memory
        return []
    if text.count("[") + text.count("{") > _MOST_BRACKETS:  # what is open is looked through at every character
        return []
    try:
        entries = yaml.safe_load(text) if text else []
    except (yaml.YAMLError, ValueError, RecursionError):
        return []
    found = []
    for entry in entries if isinstance(entries, list) else []:
        try:
            found.append(_profile(entry))
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError, FieldError):
            continue
    return found


def _entry(qos: QoSProfile) -> dict[str, Any]:
    return {
        "history": qos.history.name.lower(),
        "depth": qos.depth,
        "reliability": qos.reliability.name.lower(),
        "durability": qos.durability.name.lower(),
        "deadline": _time(qos.deadline_ns),
        "lifespan": _time(qos.lifespan_ns),
        "liveliness": qos.liveliness.name.lower(),
        "liveliness_lease_duration": _time(qos.lease_ns),
        "avoid_ros_namespace_conventions": False,
    }


def _time(nanoseconds: int) -> dict[str, int]:
    return {"sec": nanoseconds // _SECOND_NS, "nsec": nanoseconds % _SECOND_NS}


def _profile(entry: dict[str, Any]) -> QoSProfile:
    return QoSProfile(
        history=_policy(History, entry["history"]),
        depth=int(entry["depth"]),
        reliability=_policy(Reliability, entry["reliability"]),
        durability=_policy(Durability, entry["durability"]),
        deadline_ns=_nanoseconds(entry["deadline"]),
        lifespan_ns=_nanoseconds(entry["lifespan"]),
        liveliness=_policy(Liveliness, entry["liveliness"]),
        lease_ns=_nanoseconds(entry["liveliness_lease_duration"]),
    )


def _policy(kind: type[_E], value: int | str) -> _E:
    return kind(value) if isinstance(value, int) else kind[value.upper()]


def _nanoseconds(entry: dict[str, int]) -> int:
    seconds, rest = entry["sec"], entry["nsec"]
    if not (isinstance(seconds, int) and isinstance(rest, int)):  # a text times a milliard fills the memory
        raise TypeError("a duration is whole numbers")
    return min(seconds * _SECOND_NS + rest, INFINITE_NS)
