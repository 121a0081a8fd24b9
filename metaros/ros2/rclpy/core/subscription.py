"""`rclpy.subscription`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from types import GenericAlias
from typing import Any, ClassVar, TypedDict

from metaros.errors import UsageError
from metaros.node.info import MessageInfo as NativeInfo
from metaros.node.info import takes
from metaros.ros2.rclpy.core.handles import SubscriptionHandle, info_dict
from metaros.ros2.rclpy.core.rcl_errors import RCLError, UnsupportedError

__all__ = ["MessageInfo", "RCLError", "Subscription", "native_callback"]

_NO_FILTERS = "content filters are not supported on this wire (rmw_zenoh has none either): filter in the callback"


class MessageInfo(TypedDict):
    """What a callback with two arguments learns: times in nanoseconds since the epoch, the publisher's count."""

    source_timestamp: int
    received_timestamp: int
    publication_sequence_number: int | None
    reception_sequence_number: int | None


class CallbackType(Enum):
    """How many arguments a callback takes."""

    MessageOnly = 0
    WithMessageInfo = 1


def callback_type(callback: Callable[..., Any]) -> CallbackType:
    """Which it is; RuntimeError for one that takes neither one nor two."""
    try:
        return CallbackType.MessageOnly if takes(callback, 1, 2) == 1 else CallbackType.WithMessageInfo
    except UsageError:
        raise RuntimeError(
            f"Subscription.__init__(): the callback {callback!r} should be callable with one argument, the message, or"
            " with two, the message and its info"
        ) from None


def native_callback(callback: Callable[..., Any]) -> tuple[Callable[..., Any], CallbackType]:
    """What the library calls: the very callback, or one that makes rclpy's info of the library's."""
    kind = callback_type(callback)
    if kind is CallbackType.MessageOnly:
        return callback, kind

    def with_info(message: Any, info: NativeInfo) -> Any:
        return callback(message, info_dict(info.source_stamp_ns, info.received_stamp_ns, info.seq))

    return with_info, kind


class Subscription:
    """Calls back for each message of one topic. `Node.create_subscription` makes it."""

    CallbackType = CallbackType

    __class_getitem__: ClassVar[Any] = classmethod(GenericAlias)  # annotations may say of which type

    def __init__(
        self,
        subscription_impl: SubscriptionHandle,
        msg_type: type[Any],
        topic: str,
        callback: Callable[..., Any],
        callback_group: Any,
        qos_profile: Any,
        raw: bool,
        event_callbacks: Any = None,
    ) -> None:
        del event_callbacks  # they are in the handle by now: it tells of events from its first moment
        self.__subscription = subscription_impl
        self.msg_type = msg_type
        self.topic = topic
        self._callback = callback
        self._callback_type = callback_type(callback)
        self.callback_group = callback_group
        self.qos_profile = qos_profile
        self.raw = raw
        self.event_handlers: list[Any] = subscription_impl.event_handlers

    @property
    def callback(self) -> Callable[..., Any]:
        """What is called with each message; it can be set."""
        return self._callback

    @callback.setter
    def callback(self, value: Callable[..., Any]) -> None:
        native, self._callback_type = native_callback(value)
        self._callback = value
        with_info = self._callback_type is CallbackType.WithMessageInfo
        self.__subscription.replace_callback(native, with_info=with_info)

    def get_publisher_count(self) -> int:
        """Publishers that match, in this process and others."""
        with self.handle:
            return self.__subscription.get_publisher_count()

    @property
    def handle(self) -> SubscriptionHandle:
        """The library's subscription."""
        return self.__subscription

    def destroy(self) -> None:
        """End it; `Node.destroy_subscription` also takes it off the node."""
        for handler in self.event_handlers:
            handler.destroy()
        self.__subscription.destroy_when_not_in_use()

    @property
    def topic_name(self) -> str:
        """The topic's full name, remapped."""
        with self.handle:
            return self.__subscription.topic

    @property
    def logger_name(self) -> str:
        """The name of the node's logger."""
        with self.handle:
            return self.__subscription.get_logger_name()

    @property
    def is_cft_enabled(self) -> bool:
        """Whether the middleware filters: never here."""
        return False

    def set_content_filter(self, filter_expression: str, expression_parameters: Sequence[str]) -> None:
        """UnsupportedError."""
        raise UnsupportedError(_NO_FILTERS)

    def get_content_filter(self) -> Any:
        """UnsupportedError."""
        raise UnsupportedError(_NO_FILTERS)

    def __enter__(self) -> Subscription:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()
