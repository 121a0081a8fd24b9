"""Parses a channel's QoS text, as its robot announced it, as far as the gateway needs it. Pure.

The text is that of a ROS 2 liveliness token: reliability, durability, history and depth, deadline, lifespan and
liveliness between colons, each left out where it is the default, with the numbers of the rmw interface.
"""

from __future__ import annotations

__all__ = ["is_latched", "offered_qos"]

_RELIABILITY = {"1": "reliable", "2": "best_effort"}
_DURABILITY = {"1": "transient_local", "2": "volatile"}
_HISTORY = {"1": "keep_last", "2": "keep_all"}
_LIVELINESS = {"1": "automatic", "3": "manual_by_topic"}
_DEPTH = 42  # what the wire means by a depth that is left out
_INFINITE = (9223372036, 854775807)  # s, ns: how rosbag2 writes that there is no such time


def is_latched(qos: str) -> bool:
    """Whether a topic's last sample goes on holding for whoever comes later (durability transient local)."""
    return _parts(qos)[1] == "1"


def offered_qos(qos: str) -> str:
    """The text of `offered_qos_profiles` in an MCAP channel's metadata; empty when nothing is known."""
    if not qos:
        return ""
    reliability, durability, history, deadline, lifespan, liveliness = _parts(qos)
    kind, _, depth = history.partition(",")
    alive, _, lease = liveliness.partition(",")
    lines = [
        f"history: {_HISTORY.get(kind, 'keep_last')}",
        f"depth: {_number(depth, _DEPTH)}",
        f"reliability: {_RELIABILITY.get(reliability, 'reliable')}",
        f"durability: {_DURABILITY.get(durability, 'volatile')}",
        *_time("deadline", deadline),
        *_time("lifespan", lifespan),
        f"liveliness: {_LIVELINESS.get(alive, 'automatic')}",
        *_time("liveliness_lease_duration", lease),
        "avoid_ros_namespace_conventions: false",
    ]
    return "- " + "\n  ".join(lines)


def _parts(qos: str) -> list[str]:
    parts = qos.split(":")
    return parts[:6] if len(parts) >= 6 else [*parts, *[""] * (6 - len(parts))]


def _time(name: str, text: str) -> list[str]:
    seconds, _, nanoseconds = text.partition(",")
    known = _number(seconds, -1) >= 0 or _number(nanoseconds, -1) >= 0
    sec, nsec = (_number(seconds, 0), _number(nanoseconds, 0)) if known else _INFINITE
    return [f"{name}:", f"  sec: {sec}", f"  nsec: {nsec}"]


def _number(text: str, default: int) -> int:
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= 19 else default
