"""Events: what happens to an endpoint besides its samples, told to callbacks on the executor."""

from metaros.node.events.callbacks import PublisherEvents, SubscriptionEvents
from metaros.node.events.kinds import (
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
