"""The types of QoS and matching events.

`node` is the full name of the peer's node, empty where no peer is concerned or known. `total` counts since the endpoint
was made, `change` since the event before.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "DeadlineMissed",
    "Event",
    "LivelinessChanged",
    "LivelinessLost",
    "Matched",
    "MessageLost",
    "QoSIncompatible",
    "TypeMismatch",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """The fields of every event."""

    topic: str
    node: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Matched(Event):
    """A peer of the same topic, type and compatible QoS came (`current_change` 1) or went (-1)."""

    total: int
    change: int
    current: int
    current_change: int


@dataclass(frozen=True, slots=True, kw_only=True)
class QoSIncompatible(Event):
    """A peer came whose QoS does not fit ours; `policies` names the policies at odds, `reason` says it in words."""

    total: int
    change: int
    policies: tuple[str, ...]
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeMismatch(Event):
    """A peer came with another type on our topic, or with our type in another definition: nothing passes between us."""

    total: int
    change: int
    type_name: str
    type_hash: str
    peer_type_name: str
    peer_type_hash: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageLost(Event):
    """Samples were sent and never came, by the publisher's sequence numbers."""

    total: int
    change: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DeadlineMissed(Event):
    """Periods went by without a sample. `node` is, on a subscription, whose sample came last."""

    total: int
    change: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LivelinessChanged(Event):
    """A publisher came, went, let its lease pass or woke again."""

    alive: int
    alive_change: int
    not_alive: int
    not_alive_change: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LivelinessLost(Event):
    """We promised to say that we live, and let the lease pass."""

    total: int
    change: int
