"""`rclpy.service`."""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable
from types import GenericAlias
from typing import Any, ClassVar

from metaros.errors import MetarosError
from metaros.node.core import NodeCore
from metaros.node.service import PendingRequest
from metaros.ros2.rclpy.core.service_handles import RequestHeader, ServiceHandle
from metaros.ros2.rclpy.core.service_introspection import (
    REQUEST_RECEIVED,
    RESPONSE_SENT,
    Introspection,
    ServiceIntrospectionState,
)
from metaros.wire import QoSProfile as WireProfile

__all__ = ["Service"]


class Service:
    """Serves one service. `Node.create_service` makes it.

    `callback(request, response)` returns the response, or is an `async def` that does. What it raises comes out of
    `spin`, as in rclpy; the client is told that it gets no answer.
    """

    __class_getitem__: ClassVar[Any] = classmethod(GenericAlias)  # annotations may say of which type

    def __init__(
        self,
        node: NodeCore,
        srv_type: type[Any],
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        callback_group: Any,
        qos_profile: Any,
        *,
        topic: str,
        native_qos: WireProfile,
    ) -> None:
        self.srv_type = srv_type
        self.srv_name = srv_name
        self.callback = callback
        self.callback_group = callback_group
        self.qos_profile = qos_profile
        self.__introspection = Introspection(node, srv_type, topic)
        self.__service = ServiceHandle(node, srv_type, topic, self.__serve, native_qos, callback_group)
        self.__service.on_close(self.__introspection.close)

    def __serve(self, request: Any, waiting: PendingRequest) -> Awaitable[None] | None:
        """On the executor: one request."""
        if self.__introspection.on:
            self.__introspection.tell(REQUEST_RECEIVED, *waiting.key, request=request)
        try:
            result = self.callback(request, self.srv_type.Response())
        except Exception as error:
            waiting.refuse(f"{type(error).__name__}: {error}")
            raise
        if inspect.iscoroutine(result):
            return self.__answer_later(result, waiting)
        self.__answer(result, waiting)
        return None

    async def __answer_later(self, result: Awaitable[Any], waiting: PendingRequest) -> None:
        try:
            response = await result
        except Exception as error:
            waiting.refuse(f"{type(error).__name__}: {error}")
            raise
        except BaseException:  # the executor was shut down under it
            waiting.drop()
            raise
        self.__answer(response, waiting)

    def __answer(self, response: Any, waiting: PendingRequest) -> None:
        try:
            self.__send(response, waiting)
        except (TypeError, MetarosError) as error:
            waiting.refuse(f"{type(error).__name__}: {error}")
            raise

    def __send(self, response: Any, waiting: PendingRequest) -> None:
        if not isinstance(response, self.srv_type.Response):
            raise TypeError(
                f"the callback of service {self.__service.topic} must return a {self.srv_type.Response}, not"
                f" {type(response)}"
            )
        waiting.answer(response)
        if self.__introspection.on:
            self.__introspection.tell(RESPONSE_SENT, *waiting.key, response=response)

    def send_response(self, response: Any, header: RequestHeader) -> None:
        """Answer what `handle.service_take_request` gave; TypeError where the response is of another class."""
        with self.handle:
            self.__send(response, header.pending)

    def configure_introspection(
        self, clock: Any, service_event_qos_profile: Any, introspection_state: ServiceIntrospectionState
    ) -> None:
        """Tell of each call on `<service>/_service_event`, or, with OFF, no more."""
        with self.handle:
            self.__introspection.configure(clock, service_event_qos_profile, introspection_state)

    @property
    def handle(self) -> ServiceHandle:
        """The library's server."""
        return self.__service

    @property
    def service_name(self) -> str:
        """The service's full name, remapped."""
        with self.handle:
            return self.__service.service_name

    @property
    def logger_name(self) -> str:
        """The name of the node's logger."""
        with self.handle:
            return self.__service.get_logger_name()

    def destroy(self) -> None:
        """End it; `Node.destroy_service` also takes it off the node."""
        self.__service.destroy_when_not_in_use()

    def __enter__(self) -> Service:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()
