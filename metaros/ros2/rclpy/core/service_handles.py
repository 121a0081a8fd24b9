"""What stands behind rclpy's clients and servers: the library's own, with rclpy's rules for what gets no answer.

A server's callback may raise: that comes out of `spin`. A client's future stays open where no answer comes; why none
came is logged. Codecs are compiled at the first request: most services of a program are never called.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple, cast

import zenoh

from metaros.cdr import Codec, codec
from metaros.clock import SystemClock
from metaros.errors import ClosedError, PeerError, TimeoutError_
from metaros.executor import CallbackGroup
from metaros.node.client import Client as NativeClient
from metaros.node.core import NodeCore
from metaros.node.pending_call import FOREVER_S, GRACE_S, PendingCall
from metaros.node.service import PendingRequest, Responder
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.destroyable import Destroyable
from metaros.ros2.rclpy.core.graph_wait import wait_in_graph
from metaros.wire import QoSProfile
from metaros.wire.attachment import parse_attachment

__all__ = ["ClientHandle", "RequestHeader", "ServiceHandle"]


class _LazyCodec:
    """A codec that is compiled when it is first used."""

    def __init__(self, message_type: type[Any]) -> None:
        self._type = message_type

    def encode(self, message: Any) -> bytes:
        """As `Codec.encode`."""
        return codec(self._type).encode(message)

    def decode(self, data: bytes) -> Any:
        """As `Codec.decode`."""
        return codec(self._type).decode(data)


def _codecs(service_type: type[Any]) -> dict[str, Codec]:
    parts = {"request": service_type.Request, "response": service_type.Response}
    return {name: cast("Codec", _LazyCodec(part)) for name, part in parts.items()}


class RequestHeader(NamedTuple):
    """A request that waits for its answer, and when it was sent and came, in nanoseconds since the epoch."""

    pending: PendingRequest
    source_timestamp: int
    received_timestamp: int


class ServiceHandle(Destroyable, Responder):
    """A server; at most `backlog` requests wait, as many as its QoS is deep."""

    def __init__(
        self,
        node: NodeCore,
        service_type: type[Any],
        name: str,
        serve: Callable[[Any, PendingRequest], Awaitable[None] | None],
        qos: QoSProfile,
        group: CallbackGroup | None,
    ) -> None:
        Responder.__init__(
            self, node, service_type, name, serve, qos=qos, backlog=qos.depth, group=group, **_codecs(service_type)
        )

    @property
    def service_name(self) -> str:
        """The full name."""
        return self.topic

    def get_logger_name(self) -> str:
        """That of the node's logger."""
        return self.node.get_logger().name

    def service_take_request(self, request_type: type[Any]) -> tuple[Any, RequestHeader | None]:
        """The oldest request that no executor has taken, with its header; (None, None) where none has come."""
        del request_type  # it is known
        self.node.ingress.collect()
        pending = self._mailbox.pending
        while True:
            try:
                query = pending.popleft()
            except IndexError:
                return None, None
            try:
                call = parse_attachment(b"" if query.attachment is None else query.attachment.to_bytes())
                request = self._decode(b"" if query.payload is None else query.payload.to_bytes())
            except PeerError:
                query.drop()
                continue
            waiting = PendingRequest(self, query, call)
            self._waiting[waiting.key] = waiting
            return request, RequestHeader(waiting, call.source_ns, self.node.context.clock.wall_ns())

    def service_send_response(self, response: Any, header: RequestHeader) -> None:
        """Answer it."""
        header.pending.answer(response)


class ClientHandle(Destroyable, NativeClient):
    """A client that sends whether or not it knows a server, as the middleware of ROS does."""

    def __init__(self, node: NodeCore, service_type: type[Any], name: str, qos: QoSProfile) -> None:
        NativeClient.__init__(self, node, service_type, name, qos=qos, **_codecs(service_type))

    @property
    def service_name(self) -> str:
        """The full name."""
        return self.topic

    def get_logger_name(self) -> str:
        """That of the node's logger."""
        return self.node.get_logger().name

    def service_server_is_available(self) -> bool:
        """Whether a server is in the graph."""
        return self.service_is_ready()

    def send(self, request: Any) -> PendingCall:
        """Send a request; whoever wants the answer asks the call that it returns."""
        payload = self._request_bytes(request)
        call = PendingCall(self.topic, self._next_seq(), self.gid, FOREVER_S)
        self._get(call, payload, FOREVER_S + GRACE_S, zenoh.handlers.Callback(call.take, call.finish, indirect=False))
        return call

    def response_of(self, call: PendingCall) -> Any:
        """The answer to a call that has ended; None, and a line in the log, where there is none.

        As in rclpy nobody but the log hears of a server that refuses or dies: programs wait for as long as they please.
        """
        try:
            return self._response(call.outcome())
        except ClosedError:
            return None
        except PeerError as error:
            text = f"a call of {self.topic} gets no answer: {error}"
            self.warn_once(type(error), text)
            return None

    def wait_until_ready(self, timeout_s: float | None, alive: Callable[[], bool]) -> bool:
        """Wait for a server for so long (None: for ever) as `alive()`; whether one is there."""
        return wait_in_graph(self.node.graph, self.service_is_ready, timeout_s, alive)

    def call_blocking(
        self, request: Any, timeout_s: float | None, context: Context, sent: Callable[[int], object]
    ) -> tuple[int, Any]:
        """Wait for a server, send, wait for the answer: the request's number, and the answer or None where time is
        over or the context shut down.

        No executor has to spin for this. `sent(number)` is called before the wait. PeerError says why no answer can
        come any more; UsageError that this very thread would have to serve it.
        """
        until_s = None if timeout_s is None else SystemClock.monotonic_s() + timeout_s
        self.check_can_wait()
        payload = self._request_bytes(request)
        if not self.wait_until_ready(timeout_s, context.ok):
            return 0, None
        left_s = FOREVER_S if until_s is None else max(0.001, until_s - SystemClock.monotonic_s())
        self.check_can_wait()
        call = PendingCall(self.topic, self._next_seq(), self.gid, left_s)
        replies = self._get(call, payload, left_s, zenoh.handlers.FifoChannel(16))
        sent(call.seq)
        stop = context.wake_with(call.token.cancel)
        try:
            if not context.ok():  # it ended before anybody could be told
                call.cancel()
            return call.seq, self._response(call.read(replies))
        except TimeoutError_:
            return call.seq, None
        except PeerError:
            if context.ok():
                raise
            return call.seq, None
        finally:
            stop()
