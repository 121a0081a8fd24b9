"""Event callbacks of publishers and subscriptions. They run on the executor, plain or `async def`.

`group` says what they may overlap with on an executor of several threads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from metaros.executor import CallbackGroup
from metaros.node.events.event_types import (
    DeadlineMissed,
    LivelinessChanged,
    LivelinessLost,
    Matched,
    MessageLost,
    QoSIncompatible,
    TypeMismatch,
)

__all__ = ["PublisherEvents", "SubscriptionEvents"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SubscriptionEvents:
    """A subscription's events. Without `incompatible_qos` or `type_hash_mismatch` the node logs a warning instead."""

    incompatible_qos: Callable[[QoSIncompatible], Any] | None = None
    type_hash_mismatch: Callable[[TypeMismatch], Any] | None = None
    matched: Callable[[Matched], Any] | None = None
    message_lost: Callable[[MessageLost], Any] | None = None
    deadline_missed: Callable[[DeadlineMissed], Any] | None = None
    liveliness_changed: Callable[[LivelinessChanged], Any] | None = None
    group: CallbackGroup | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PublisherEvents:
    """A publisher's events. Without `incompatible_qos` or `type_hash_mismatch` the node logs a warning instead."""

    incompatible_qos: Callable[[QoSIncompatible], Any] | None = None
    type_hash_mismatch: Callable[[TypeMismatch], Any] | None = None
    matched: Callable[[Matched], Any] | None = None
    deadline_missed: Callable[[DeadlineMissed], Any] | None = None
    liveliness_lost: Callable[[LivelinessLost], Any] | None = None
    group: CallbackGroup | None = None
