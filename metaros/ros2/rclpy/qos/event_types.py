"""What events of publishers and subscriptions tell, by rclpy's names, and how they are read from this library's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, NamedTuple

from metaros.node.events import LivelinessChanged, Matched, QoSIncompatible, TypeMismatch
from metaros.ros2.rclpy.core.rcl_errors import UnsupportedEventTypeError
from metaros.ros2.rclpy.qos.policies import QoSPolicyKind

__all__ = [
    "IncompatibleTypeInfo",
    "QoSLivelinessChangedInfo",
    "QoSLivelinessLostInfo",
    "QoSMessageLostInfo",
    "QoSOfferedDeadlineMissedInfo",
    "QoSOfferedIncompatibleQoSInfo",
    "QoSPublisherEventType",
    "QoSPublisherMatchedInfo",
    "QoSRequestedDeadlineMissedInfo",
    "QoSRequestedIncompatibleQoSInfo",
    "QoSSubscriptionEventType",
    "QoSSubscriptionMatchedInfo",
    "native_kind",
    "reader_of",
]


class QoSPublisherEventType(IntEnum):
    """The events of a publisher."""

    RCL_PUBLISHER_OFFERED_DEADLINE_MISSED = 0
    RCL_PUBLISHER_LIVELINESS_LOST = 1
    RCL_PUBLISHER_OFFERED_INCOMPATIBLE_QOS = 2
    RCL_PUBLISHER_INCOMPATIBLE_TYPE = 3
    RCL_PUBLISHER_MATCHED = 4


class QoSSubscriptionEventType(IntEnum):
    """The events of a subscription."""

    RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED = 0
    RCL_SUBSCRIPTION_LIVELINESS_CHANGED = 1
    RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS = 2
    RCL_SUBSCRIPTION_MESSAGE_LOST = 3
    RCL_SUBSCRIPTION_INCOMPATIBLE_TYPE = 4
    RCL_SUBSCRIPTION_MATCHED = 5


@dataclass(slots=True)
class _Count:
    """`total_count` since the endpoint was made, `total_count_change` since the event before."""

    total_count: int = 0
    total_count_change: int = 0


@dataclass(slots=True)
class QoSRequestedDeadlineMissedInfo(_Count):
    """Periods in which no sample came."""


@dataclass(slots=True)
class QoSOfferedDeadlineMissedInfo(_Count):
    """Periods in which none was published."""


@dataclass(slots=True)
class QoSLivelinessLostInfo(_Count):
    """The publisher let its lease pass."""


@dataclass(slots=True)
class QoSMessageLostInfo(_Count):
    """Samples that were sent and never came."""


@dataclass(slots=True)
class QoSRequestedIncompatibleQoSInfo(_Count):
    """A peer came whose profile does not fit; `last_policy_kind` is a `QoSPolicyKind`."""

    last_policy_kind: int = QoSPolicyKind.INVALID


QoSOfferedIncompatibleQoSInfo = QoSRequestedIncompatibleQoSInfo


@dataclass(slots=True)
class IncompatibleTypeInfo(_Count):
    """A peer came with another type. `reason`, which rclpy does not have, says with which."""

    reason: str = ""


@dataclass(slots=True)
class QoSPublisherMatchedInfo(_Count):
    """A peer came or went; `current_count` is how many there are."""

    current_count: int = 0
    current_count_change: int = 0


QoSSubscriptionMatchedInfo = QoSPublisherMatchedInfo


@dataclass(slots=True)
class QoSLivelinessChangedInfo:
    """A publisher came, went, let its lease pass or woke again."""

    alive_count: int = 0
    not_alive_count: int = 0
    alive_count_change: int = 0
    not_alive_count_change: int = 0


def _counted(kind: type[Any]) -> Callable[[Any], Any]:
    return lambda event: kind(event.total, event.change)


def _incompatible(event: QoSIncompatible) -> QoSRequestedIncompatibleQoSInfo:
    last = event.policies[-1].upper() if event.policies else "INVALID"
    return QoSRequestedIncompatibleQoSInfo(event.total, event.change, QoSPolicyKind[last])


def _mismatch(event: TypeMismatch) -> IncompatibleTypeInfo:
    if event.type_name == event.peer_type_name:
        reason = f"{event.node} has {event.type_name} by another definition, {event.peer_type_hash}"
    else:
        reason = f"{event.node} has {event.peer_type_name}, here it is {event.type_name}"
    return IncompatibleTypeInfo(event.total, event.change, reason)


def _matched(event: Matched) -> QoSPublisherMatchedInfo:
    return QoSPublisherMatchedInfo(event.total, event.change, event.current, event.current_change)


def _liveliness(event: LivelinessChanged) -> QoSLivelinessChangedInfo:
    return QoSLivelinessChangedInfo(event.alive, event.not_alive, event.alive_change, event.not_alive_change)


class _Kind(NamedTuple):
    native: str  # the field of `PublisherEvents` or `SubscriptionEvents`
    read: Callable[[Any], Any]


_PUBLISHER: Final[dict[int, _Kind]] = {
    QoSPublisherEventType.RCL_PUBLISHER_OFFERED_DEADLINE_MISSED: _Kind(
        "deadline_missed", _counted(QoSOfferedDeadlineMissedInfo)
    ),
    QoSPublisherEventType.RCL_PUBLISHER_LIVELINESS_LOST: _Kind("liveliness_lost", _counted(QoSLivelinessLostInfo)),
    QoSPublisherEventType.RCL_PUBLISHER_OFFERED_INCOMPATIBLE_QOS: _Kind("incompatible_qos", _incompatible),
    QoSPublisherEventType.RCL_PUBLISHER_INCOMPATIBLE_TYPE: _Kind("type_hash_mismatch", _mismatch),
    QoSPublisherEventType.RCL_PUBLISHER_MATCHED: _Kind("matched", _matched),
}
_SUBSCRIPTION: Final[dict[int, _Kind]] = {
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED: _Kind(
        "deadline_missed", _counted(QoSRequestedDeadlineMissedInfo)
    ),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_LIVELINESS_CHANGED: _Kind("liveliness_changed", _liveliness),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS: _Kind("incompatible_qos", _incompatible),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST: _Kind("message_lost", _counted(QoSMessageLostInfo)),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_INCOMPATIBLE_TYPE: _Kind("type_hash_mismatch", _mismatch),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED: _Kind("matched", _matched),
}


def _kind(event_type: IntEnum) -> _Kind:
    try:
        if isinstance(event_type, QoSPublisherEventType):
            return _PUBLISHER[event_type]
        return _SUBSCRIPTION[event_type]
    except (KeyError, TypeError):
        raise UnsupportedEventTypeError(f"no event {event_type!r} is reported here") from None


def native_kind(event_type: IntEnum) -> str:
    """The name of this library's callback for such events; UnsupportedEventTypeError where there is none."""
    return _kind(event_type).native


def reader_of(event_type: IntEnum) -> Callable[[Any], Any]:
    """What makes rclpy's info of this library's event."""
    return _kind(event_type).read
