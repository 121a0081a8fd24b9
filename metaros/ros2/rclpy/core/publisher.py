"""`rclpy.publisher`."""

from __future__ import annotations

from collections.abc import Callable
from types import GenericAlias
from typing import Any, ClassVar

from metaros.cdr import codec
from metaros.errors import ClosedError, FieldError
from metaros.ros2.rclpy.core.handles import PublisherHandle
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle, RCLError

__all__ = ["Publisher"]


class Publisher:
    """Publishes messages of one type on one topic. `Node.create_publisher` makes it.

    Where a class that derives from it has its own `publish`, that one is called, else a shorter way is taken.
    """

    __class_getitem__: ClassVar[Any] = classmethod(GenericAlias)  # annotations may say of which type

    def __init__(
        self,
        publisher_impl: PublisherHandle,
        msg_type: type[Any],
        topic: str,
        qos_profile: Any,
        event_callbacks: Any = None,
        callback_group: Any = None,
    ) -> None:
        del event_callbacks, callback_group  # they are in the handle by now: it tells of events from its first moment
        self.__publisher = publisher_impl
        self.__send = _sender(publisher_impl, msg_type)
        self.msg_type = msg_type
        self.topic = topic
        self.qos_profile = qos_profile
        self.event_handlers: list[Any] = publisher_impl.event_handlers
        if type(self).publish is Publisher.publish:
            self.publish = self.__send  # type: ignore[assignment,method-assign]

    def publish(self, msg: Any) -> None:
        """Send a message, or its CDR as bytes.

        Raises:
            TypeError: it is neither.
            FieldError: a field's value does not fit.
            InvalidHandle, RCLError: the publisher was destroyed, the context shut down.
        """
        self.__send(msg)

    def get_subscription_count(self) -> int:
        """Subscriptions that match, in this process and others."""
        with self.handle:
            return self.__publisher.get_subscription_count()

    @property
    def topic_name(self) -> str:
        """The topic's full name, remapped."""
        with self.handle:
            return self.__publisher.topic

    @property
    def logger_name(self) -> str:
        """The name of the node's logger."""
        with self.handle:
            return self.__publisher.get_logger_name()

    @property
    def handle(self) -> PublisherHandle:
        """The library's publisher."""
        return self.__publisher

    def destroy(self) -> None:
        """End it; `Node.destroy_publisher` also takes it off the node."""
        for handler in self.event_handlers:
            handler.destroy()
        self.__publisher.destroy_when_not_in_use()

    def assert_liveliness(self) -> None:
        """Say that the publisher lives: with MANUAL_BY_TOPIC it must say so within each lease."""
        with self.handle:
            self.__publisher.assert_liveliness()

    def wait_for_all_acked(self, timeout: Any = None) -> bool:
        """True: on this wire nothing is acknowledged one by one, and rmw_zenoh answers so, too."""
        del timeout
        with self.handle:
            return True

    def __enter__(self) -> Publisher:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()


def _sender(handle: PublisherHandle, msg_type: type[Any]) -> Callable[[Any], None]:
    """`publish`, which costs one call more than the library's own; everything unusual is left to the errors."""
    send = handle.publish

    def publish(msg: Any) -> None:
        try:
            send(msg)
        except FieldError:
            if msg.__class__ is msg_type or isinstance(msg, bytes):
                raise
            if not isinstance(msg, msg_type):
                raise TypeError(f"Expected {msg_type}, got {type(msg)}") from None
            send(codec(msg_type).encode(msg))  # of a class that derives from it
        except ClosedError as error:
            if handle.node.context.closed:
                raise RCLError(f"Failed to publish: the context is not valid any more: {error}") from None
            raise InvalidHandle(f"cannot use Publisher of {handle.topic}: it was destroyed") from None

    return publish
