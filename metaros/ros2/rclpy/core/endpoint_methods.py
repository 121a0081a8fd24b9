"""What a node creates on topics and services, and destroys: `rclpy.node.Node` inherits it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from metaros.executor import CallbackGroup
from metaros.ros2.rclpy.core.client import Client
from metaros.ros2.rclpy.core.handles import NodeHandle, PublisherHandle, Resolved, SubscriptionHandle
from metaros.ros2.rclpy.core.publisher import Publisher
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle, UnsupportedError
from metaros.ros2.rclpy.core.service import Service
from metaros.ros2.rclpy.core.service_handles import ClientHandle
from metaros.ros2.rclpy.core.subscription import Subscription, native_callback
from metaros.ros2.rclpy.names.expand_topic_name import expand_topic_name
from metaros.ros2.rclpy.names.type_support import check_is_valid_msg_type, check_is_valid_srv_type
from metaros.ros2.rclpy.names.validate_full_topic_name import validate_full_topic_name
from metaros.ros2.rclpy.names.validate_topic_name import validate_topic_name
from metaros.ros2.rclpy.qos.conversion import to_native
from metaros.ros2.rclpy.qos.event_handler import (
    PublisherEventCallbacks,
    SubscriptionEventCallbacks,
    publisher_events,
    subscription_events,
)
from metaros.ros2.rclpy.qos.profile import QoSProfile, qos_profile_services_default
from metaros.ros2.rclpy.qos.qos_overriding_options import QoSOverridingOptions, declare_qos_parameters
from metaros.wire import QoSProfile as WireProfile

__all__ = ["EndpointMethods", "qos_or_depth"]


def qos_or_depth(qos_or_depth: Any) -> QoSProfile:
    """The profile, or the default one with that depth.

    Raises:
        ValueError: the depth is negative.
        TypeError: it is neither.
    """
    if isinstance(qos_or_depth, QoSProfile):
        return qos_or_depth
    if isinstance(qos_or_depth, int):
        if qos_or_depth < 0:
            raise ValueError(f"history depth must be greater than or equal to zero, not {qos_or_depth}")
        return QoSProfile(depth=qos_or_depth)
    raise TypeError(f"Expected QoSProfile or int, but received {type(qos_or_depth)!r}")


class EndpointMethods:
    """Publishers, subscriptions, clients and service servers of one node."""

    handle: NodeHandle
    default_callback_group: CallbackGroup

    def _init_endpoints(self) -> None:
        """Begin without any."""
        self._publishers: list[Publisher] = []
        self._subscriptions: list[Subscription] = []
        self._clients: list[Client] = []
        self._services: list[Service] = []

    def _wake_executor(self) -> None:
        """Make it look around."""

    # -- names -----------------------------------------------------------------------------------------------------

    def __resolve(self, name: str, *, service: bool) -> Resolved:
        """The full name that `name` means on this node; rclpy's errors where it means none."""
        handle = self.handle
        with handle:
            validate_topic_name(name, is_service=service)
            full = expand_topic_name(name, handle.name, handle.namespace)
            validate_full_topic_name(full, is_service=service)
            return Resolved(handle.arguments.remapped(full, service=service))

    # -- topics ----------------------------------------------------------------------------------------------------

    def create_publisher(
        self,
        msg_type: type[Any],
        topic: str,
        qos_profile: QoSProfile | int,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: PublisherEventCallbacks | None = None,
        qos_overriding_options: QoSOverridingOptions | None = None,
        publisher_class: type[Publisher] = Publisher,
    ) -> Publisher:
        """Publish messages of `msg_type` on `topic`; a number is the depth of the default profile.

        `callback_group` is that of the event callbacks, `qos_overriding_options` say which policies parameters may
        override.

        Raises:
            InvalidTopicNameException, ValueError, TypeError: the name, the profile or the type is none.
        """
        qos = qos_or_depth(qos_profile)
        group = callback_group or self.default_callback_group
        full = self.__resolve(topic, service=False)
        if qos_overriding_options is not None:
            declare_qos_parameters(Publisher, self, full, qos, qos_overriding_options)
        check_is_valid_msg_type(msg_type)
        callbacks = event_callbacks or PublisherEventCallbacks()
        handlers = callbacks.create_event_handlers(group, self.handle, topic)
        native_qos = self.__native(qos, full, publishes=True)
        impl = PublisherHandle(
            self.handle, msg_type, full, native_qos, publisher_events(handlers, group), event_handlers=handlers
        )
        try:
            publisher = publisher_class(impl, msg_type, topic, qos, event_callbacks=callbacks, callback_group=group)
        except Exception:
            impl.destroy_when_not_in_use()
            raise
        self._publishers.append(publisher)
        self._wake_executor()
        return publisher

    def create_subscription(
        self,
        msg_type: type[Any],
        topic: str,
        callback: Callable[..., Any],
        qos_profile: QoSProfile | int,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: SubscriptionEventCallbacks | None = None,
        qos_overriding_options: QoSOverridingOptions | None = None,
        raw: bool = False,
        content_filter_options: Any = None,
    ) -> Subscription:
        """Call `callback(message)` or `callback(message, info)` for each message on `topic`; with `raw` for its CDR.

        Other options and errors as of `create_publisher`; UnsupportedError for a content filter, RuntimeError where
        the callback takes neither one nor two arguments.
        """
        qos = qos_or_depth(qos_profile)
        group = callback_group or self.default_callback_group
        full = self.__resolve(topic, service=False)
        if content_filter_options is not None:
            raise UnsupportedError(
                f"create_subscription on {full}: content filters are not supported on this wire (rmw_zenoh has none"
                " either): leave content_filter_options away and filter in the callback"
            )
        if qos_overriding_options is not None:
            declare_qos_parameters(Subscription, self, full, qos, qos_overriding_options)
        check_is_valid_msg_type(msg_type)
        callbacks = event_callbacks or SubscriptionEventCallbacks()
        handlers = callbacks.create_event_handlers(group, self.handle, topic)
        impl = SubscriptionHandle(
            self.handle,
            msg_type,
            full,
            self.__native(qos, full, publishes=False),
            native_callback(callback)[0],
            raw=raw,
            events=subscription_events(handlers, group),
            group=group,
            event_handlers=handlers,
        )
        subscription = Subscription(impl, msg_type, topic, callback, group, qos, raw, event_callbacks=callbacks)
        self.__join(group, subscription)
        self._subscriptions.append(subscription)
        self._wake_executor()
        return subscription

    def __native(self, qos: QoSProfile, full: str, *, publishes: bool) -> WireProfile:
        """The wire's profile; "best available" is chosen by who is on the topic now."""
        peers = [info.qos for info in self.handle.graph.endpoints(full, "MS" if publishes else "MP")]
        return to_native(qos, peers=peers, publishes=publishes)

    # -- services --------------------------------------------------------------------------------------------------

    def create_client(
        self,
        srv_type: type[Any],
        srv_name: str,
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Client:
        """Call the service `srv_name`; responses come in `callback_group`."""
        group = callback_group or self.default_callback_group
        full = self.__resolve(srv_name, service=True)
        check_is_valid_srv_type(srv_type)
        impl = ClientHandle(self.handle, srv_type, full, to_native(qos_profile))
        client = Client(self.handle.rclpy_context, impl, srv_type, srv_name, qos_profile, group)
        self.__join(group, client)
        self._clients.append(client)
        self._wake_executor()
        return client

    def create_service(
        self,
        srv_type: type[Any],
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        qos_profile: QoSProfile = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Service:
        """Serve `srv_name` with `callback(request, response)`, which returns the response."""
        group = callback_group or self.default_callback_group
        full = self.__resolve(srv_name, service=True)
        check_is_valid_srv_type(srv_type)
        service = Service(
            self.handle, srv_type, srv_name, callback, group, qos_profile, topic=full, native_qos=to_native(qos_profile)
        )
        self.__join(group, service)
        self._services.append(service)
        self._wake_executor()
        return service

    @staticmethod
    def __join(group: CallbackGroup, entity: Any) -> None:
        add = getattr(group, "add_entity", None)  # a group of the library itself keeps no list
        if add is not None:
            add(entity)

    # -- the end ---------------------------------------------------------------------------------------------------

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """End a publisher of this node; whether there was something to end."""
        return self.__destroy(publisher, self._publishers)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """End a subscription of this node; whether there was something to end."""
        return self.__destroy(subscription, self._subscriptions)

    def destroy_client(self, client: Client) -> bool:
        """End a client of this node; whether there was something to end."""
        return self.__destroy(client, self._clients)

    def destroy_service(self, service: Service) -> bool:
        """End a server of this node; whether there was something to end."""
        return self.__destroy(service, self._services)

    def __destroy(self, entity: Any, among: list[Any]) -> bool:
        if entity not in among:
            return False
        among.remove(entity)
        try:
            entity.destroy()
        except InvalidHandle:
            return False
        self._wake_executor()
        return True
