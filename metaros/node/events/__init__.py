"""Events: what happens to an endpoint besides its samples, reported to callbacks on the executor."""

from metaros.node.events.callbacks import PublisherEvents, SubscriptionEvents
from metaros.node.events.event_types import (
    DeadlineMissed,
    LivelinessChanged,
    LivelinessLost,
    Matched,
    MessageLost,
    QoSIncompatible,
    TypeMismatch,
)

__all__ = [
    "DeadlineMissed",
    "LivelinessChanged",
    "LivelinessLost",
    "Matched",
    "MessageLost",
    "PublisherEvents",
    "QoSIncompatible",
    "SubscriptionEvents",
    "TypeMismatch",
]
