"""`rclpy.event_handler`: callbacks for what happens to a publisher or subscription besides its samples.

They run on the executor of the node, in the callback group of their endpoint. This library reports every kind of event.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import Any, Final, TypeVar

from metaros.executor import CallbackGroup
from metaros.node.events import PublisherEvents, SubscriptionEvents
from metaros.ros2.rclpy.core.rcl_errors import UnsupportedEventTypeError
from metaros.ros2.rclpy.logging.loggers import get_logger
from metaros.ros2.rclpy.qos.event_types import (
    IncompatibleTypeInfo,
    QoSLivelinessChangedInfo,
    QoSLivelinessLostInfo,
    QoSMessageLostInfo,
    QoSOfferedDeadlineMissedInfo,
    QoSOfferedIncompatibleQoSInfo,
    QoSPublisherEventType,
    QoSPublisherMatchedInfo,
    QoSRequestedDeadlineMissedInfo,
    QoSRequestedIncompatibleQoSInfo,
    QoSSubscriptionEventType,
    QoSSubscriptionMatchedInfo,
    native_kind,
    reader_of,
)
from metaros.ros2.rclpy.qos.policies import qos_policy_name_from_kind

__all__ = [
    "EventHandler",
    "IncompatibleTypeInfo",
    "PublisherEventCallbacks",
    "QoSEventHandler",
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
    "SubscriptionEventCallbacks",
    "UnsupportedEventTypeError",
    "publisher_events",
    "subscription_events",
]

_Events = TypeVar("_Events", PublisherEvents, SubscriptionEvents)


class EventHandler:
    """One callback for one kind of event. `publisher_events` and `subscription_events` put it to work."""

    def __init__(
        self, *, callback_group: CallbackGroup | None, callback: Callable[[Any], Any], event_type: IntEnum, **_: Any
    ) -> None:
        self.callback_group = callback_group
        self.callback = callback
        self.event_type = event_type
        self.native_kind = native_kind(event_type)
        self._read = reader_of(event_type)
        self._destroyed = False

    def deliver(self, event: Any) -> Any:
        """Call the callback, on the executor; what it raises comes out of `spin`, as in rclpy."""
        if self._destroyed:
            return None
        try:
            result = self.callback(self._read(event))
        except Exception as error:
            return _raising(error)
        return result if inspect.iscoroutine(result) else None

    def destroy(self) -> None:
        """Call it no more."""
        self._destroyed = True


async def _raising(error: Exception) -> None:
    raise error


class QoSEventHandler(EventHandler):
    """The name of `EventHandler` until Iron."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        warnings.warn("QoSEventHandler is deprecated, use EventHandler instead.", DeprecationWarning, stacklevel=2)
        super().__init_subclass__(**kwargs)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        warnings.warn("QoSEventHandler is deprecated, use EventHandler instead.", DeprecationWarning, stacklevel=2)
        super().__init__(*args, **kwargs)


class SubscriptionEventCallbacks:
    """Callbacks of a subscription. With `use_default_callbacks` the node warns of what has no callback here and would
    keep messages away: profiles or types that do not fit.
    """

    def __init__(
        self,
        *,
        deadline: Callable[[QoSRequestedDeadlineMissedInfo], Any] | None = None,
        incompatible_qos: Callable[[QoSRequestedIncompatibleQoSInfo], Any] | None = None,
        liveliness: Callable[[QoSLivelinessChangedInfo], Any] | None = None,
        message_lost: Callable[[QoSMessageLostInfo], Any] | None = None,
        incompatible_type: Callable[[IncompatibleTypeInfo], Any] | None = None,
        matched: Callable[[QoSSubscriptionMatchedInfo], Any] | None = None,
        use_default_callbacks: bool = True,
    ) -> None:
        self.deadline = deadline
        self.incompatible_qos = incompatible_qos
        self.liveliness = liveliness
        self.message_lost = message_lost
        self.incompatible_type = incompatible_type
        self.matched = matched
        self.use_default_callbacks = use_default_callbacks

    def create_event_handlers(
        self, callback_group: CallbackGroup | None, subscription: Any, topic_name: str
    ) -> list[EventHandler]:
        """A handler for each callback. `subscription` is the native node or endpoint: what has a `get_logger()`."""
        kinds = QoSSubscriptionEventType
        incompatible_qos, incompatible_type = self.incompatible_qos, self.incompatible_type
        if self.use_default_callbacks:
            incompatible_qos = incompatible_qos or _qos_warning(
                subscription,
                f"New publisher discovered on topic '{topic_name}', offering incompatible QoS. "
                "No messages will be received from it. ",
            )
            incompatible_type = incompatible_type or _type_warning(subscription, topic_name)
        return _handlers(
            callback_group,
            (kinds.RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED, self.deadline),
            (kinds.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS, incompatible_qos),
            (kinds.RCL_SUBSCRIPTION_LIVELINESS_CHANGED, self.liveliness),
            (kinds.RCL_SUBSCRIPTION_MESSAGE_LOST, self.message_lost),
            (kinds.RCL_SUBSCRIPTION_INCOMPATIBLE_TYPE, incompatible_type),
            (kinds.RCL_SUBSCRIPTION_MATCHED, self.matched),
        )


class PublisherEventCallbacks:
    """Callbacks of a publisher; `use_default_callbacks` as for a subscription."""

    def __init__(
        self,
        *,
        deadline: Callable[[QoSOfferedDeadlineMissedInfo], Any] | None = None,
        liveliness: Callable[[QoSLivelinessLostInfo], Any] | None = None,
        incompatible_qos: Callable[[QoSRequestedIncompatibleQoSInfo], Any] | None = None,
        incompatible_type: Callable[[IncompatibleTypeInfo], Any] | None = None,
        matched: Callable[[QoSPublisherMatchedInfo], Any] | None = None,
        use_default_callbacks: bool = True,
    ) -> None:
        self.deadline = deadline
        self.liveliness = liveliness
        self.incompatible_qos = incompatible_qos
        self.incompatible_type = incompatible_type
        self.matched = matched
        self.use_default_callbacks = use_default_callbacks

    def create_event_handlers(
        self, callback_group: CallbackGroup | None, publisher: Any, topic_name: str
    ) -> list[EventHandler]:
        """A handler for each callback. `publisher` is the native node or endpoint: what has a `get_logger()`."""
        kinds = QoSPublisherEventType
        incompatible_qos, incompatible_type = self.incompatible_qos, self.incompatible_type
        if self.use_default_callbacks:
            incompatible_qos = incompatible_qos or _qos_warning(
                publisher,
                f"New subscription discovered on topic '{topic_name}', requesting incompatible QoS. "
                "No messages will be sent to it. ",
            )
            incompatible_type = incompatible_type or _type_warning(publisher, topic_name)
        return _handlers(
            callback_group,
            (kinds.RCL_PUBLISHER_OFFERED_DEADLINE_MISSED, self.deadline),
            (kinds.RCL_PUBLISHER_LIVELINESS_LOST, self.liveliness),
            (kinds.RCL_PUBLISHER_OFFERED_INCOMPATIBLE_QOS, incompatible_qos),
            (kinds.RCL_PUBLISHER_INCOMPATIBLE_TYPE, incompatible_type),
            (kinds.RCL_PUBLISHER_MATCHED, self.matched),
        )


def publisher_events(handlers: Iterable[EventHandler], group: CallbackGroup | None = None) -> PublisherEvents:
    """What this library's publishers take as `events=`."""
    return _events(PublisherEvents, handlers, group)


def subscription_events(handlers: Iterable[EventHandler], group: CallbackGroup | None = None) -> SubscriptionEvents:
    """What this library's subscriptions take as `events=`."""
    return _events(SubscriptionEvents, handlers, group)


def _events(kind: type[_Events], handlers: Iterable[EventHandler], group: CallbackGroup | None) -> _Events:
    # Where there is no handler, nothing is said: the warnings are the default handlers' part, in rclpy's words.
    callbacks: dict[str, Any] = {"incompatible_qos": _silent, "type_hash_mismatch": _silent}
    callbacks.update({handler.native_kind: handler.deliver for handler in handlers})
    return kind(group=group, **callbacks)


def _silent(_: Any) -> None:
    """For events that nobody wants to hear of."""


def _handlers(
    group: CallbackGroup | None, *callbacks: tuple[IntEnum, Callable[[Any], Any] | None]
) -> list[EventHandler]:
    return [
        EventHandler(callback_group=group, callback=callback, event_type=event_type)
        for event_type, callback in callbacks
        if callback is not None
    ]


_ON_ZENOH: Final = (  # what rclpy's own sentence does not know
    "That is so on DDS. On Zenoh, as with rmw_zenoh, messages pass all the same, without what the policy promises"
)


def _logger_of(handle: Any) -> Any:
    node = getattr(handle, "node", handle)
    return get_logger(node.get_logger().name)


def _qos_warning(handle: Any, text: str) -> Callable[[QoSRequestedIncompatibleQoSInfo], None]:
    logger = _logger_of(handle)

    def warn(event: QoSRequestedIncompatibleQoSInfo) -> None:
        logger.warn(f"{text}Last incompatible policy: {qos_policy_name_from_kind(event.last_policy_kind)}")
        logger.warn(_ON_ZENOH, once=True)

    return warn


def _type_warning(handle: Any, topic_name: str) -> Callable[[IncompatibleTypeInfo], None]:
    logger = _logger_of(handle)

    def warn(event: IncompatibleTypeInfo) -> None:
        text = f"Incompatible type on topic '{topic_name}', no messages will be sent to it"
        logger.warn(f"{text}: {event.reason}" if event.reason else f"{text}.")

    return warn
