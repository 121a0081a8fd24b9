"""`rclpy.client`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Coroutine
from types import GenericAlias
from typing import Any, ClassVar

from metaros.errors import PeerError
from metaros.node.pending_call import PendingCall
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.rcl_errors import RCLError
from metaros.ros2.rclpy.core.service_handles import ClientHandle
from metaros.ros2.rclpy.core.service_introspection import (
    REQUEST_SENT,
    RESPONSE_RECEIVED,
    Introspection,
    ServiceIntrospectionState,
)
from metaros.ros2.rclpy.execution.inbox import Inbox
from metaros.ros2.rclpy.execution.task import Future

__all__ = ["Client"]


class Client:
    """Calls one service. `Node.create_client` makes it."""

    __class_getitem__: ClassVar[Any] = classmethod(GenericAlias)  # annotations may say of which type

    def __init__(
        self,
        context: Context,
        client_impl: ClientHandle,
        srv_type: type[Any],
        srv_name: str,
        qos_profile: Any,
        callback_group: Any,
    ) -> None:
        self.context = context
        self.__client = client_impl
        self.srv_type = srv_type
        self.srv_name = srv_name
        self.qos_profile = qos_profile
        self.callback_group = callback_group
        self._pending_requests: dict[int, Any] = {}
        self._lock = threading.Lock()
        self.__calls: dict[int, PendingCall] = {}
        self.__inbox = Inbox(client_impl.node, self.__complete, callback_group, entity=self)
        self.__introspection = Introspection(client_impl.node, srv_type, client_impl.topic)
        client_impl.on_close(self.__introspection.close)

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Send the request and block for the response; None where it is not there after `timeout_sec`.

        Waits for a server, too. No executor has to spin, and a callback may call it, unless the server would have to
        run on the same thread: UsageError then, where rclpy waits for ever.

        Raises:
            TypeError: the request is of another class.
            PeerError: without a `timeout_sec`, the server refused, or died before it answered.
        """
        self.__check(request)
        with self.handle:
            handle, introspection = self.__client, self.__introspection

            def sent(number: int) -> None:
                if introspection.on:
                    introspection.tell(REQUEST_SENT, handle.gid, number, request=request)

            try:
                number, response = handle.call_blocking(request, timeout_sec, self.context, sent)
            except PeerError as error:
                if timeout_sec is None:
                    raise
                handle.warn_once(type(error), f"a call of {handle.topic} gets no answer: {error}")
                return None
            if introspection.on and response is not None:
                introspection.tell(RESPONSE_RECEIVED, handle.gid, number, response=response)
            return response

    def call_async(self, request: Any) -> Future[Any]:
        """Send the request; a future of the response, which is set on the executor that spins the node.

        It stays open where no answer comes, as in rclpy; TypeError where the request is of another class.
        """
        self.__check(request)
        with self.handle:
            future: Future[Any] = Future()
            call = self.__client.send(request)
            with self._lock:
                self._pending_requests[call.seq] = future
                self.__calls[call.seq] = call
            if self.__introspection.on:
                self.__introspection.tell(REQUEST_SENT, self.__client.gid, call.seq, request=request)
            future.add_done_callback(self.remove_pending_request)
            call.when_finished(_put(self.__inbox, call))
        return future

    def __check(self, request: Any) -> None:
        if not isinstance(request, self.srv_type.Request):
            raise TypeError(f"Expected {self.srv_type.Request}, got {type(request)}")

    def __complete(self, call: PendingCall) -> Coroutine[Any, Any, None] | None:
        """On the executor: the call has ended."""
        with self._lock:
            future = self._pending_requests.pop(call.seq, None)
            self.__calls.pop(call.seq, None)
        if future is None:
            return None
        response = self.__client.response_of(call)
        if response is None or future.done():
            return None
        if self.__introspection.on:
            self.__introspection.tell(RESPONSE_RECEIVED, self.__client.gid, call.seq, response=response)
        return self._deliver(future, response)

    def _deliver(self, future: Future[Any], response: Any) -> Coroutine[Any, Any, None] | None:
        """The response is there, and somebody waits for it still."""
        future.set_result(response)
        return None

    def get_pending_request(self, sequence_number: int) -> Future[Any]:
        """The future of a request by its number; KeyError where none waits."""
        with self._lock:
            return self._pending_requests[sequence_number]  # type: ignore[no-any-return]

    def remove_pending_request(self, future: Future[Any]) -> None:
        """Wait no more for this one: a response that still comes is ignored."""
        with self._lock:
            found = [number for number, other in self._pending_requests.items() if other is future]
            calls = [self.__calls.pop(number, None) for number in found]
            for number in found:
                del self._pending_requests[number]
        for call in calls:
            if call is not None and not call.finished:
                call.cancel()

    def service_is_ready(self) -> bool:
        """Whether a server is in the graph."""
        with self.handle:
            return self.__client.service_is_ready()

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait for a server, without a `timeout_sec` for ever; whether one is there.

        RCLError where the context is shut down: a loop around this would never end.
        """
        with self.handle:
            ready = self.__client.wait_until_ready(timeout_sec, self.context.ok)
        if not ready and not self.context.ok():
            raise RCLError(f"there is no telling whether {self.service_name} is served: the context is shut down")
        return ready

    def configure_introspection(
        self, clock: Any, service_event_qos_profile: Any, introspection_state: ServiceIntrospectionState
    ) -> None:
        """Tell of each call on `<service>/_service_event`, or, with OFF, no more."""
        with self.handle:
            self.__introspection.configure(clock, service_event_qos_profile, introspection_state)

    @property
    def handle(self) -> ClientHandle:
        """The library's client."""
        return self.__client

    @property
    def service_name(self) -> str:
        """The service's full name, remapped."""
        with self.handle:
            return self.__client.service_name

    @property
    def logger_name(self) -> str:
        """The name of the node's logger."""
        with self.handle:
            return self.__client.get_logger_name()

    def destroy(self) -> None:
        """End it; `Node.destroy_client` also takes it off the node."""
        self.__client.destroy_when_not_in_use()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()


def _put(inbox: Inbox, call: PendingCall) -> Callable[[], None]:
    def put() -> None:
        inbox.put(call)

    return put
