"""Service clients: blocking calls, coroutines and futures, typed or in CDR bytes."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Final, TypeGuard, TypeVar

import zenoh

from metaros.cdr import Codec, codec
from metaros.errors import ClosedError, FieldError, UnavailableError, UsageError
from metaros.idl import remember_class
from metaros.node.call_futures import CallFuture, CallFutures
from metaros.node.core import NodeCore
from metaros.node.endpoint import Endpoint, as_qos
from metaros.node.pending_call import FOREVER_S, GRACE_S, PendingCall, Reply
from metaros.wire import DataKey, QoSProfile, pack_attachment, qos_services
from metaros.wire.graph import Token
from metaros.wire.liveliness_tokens import EndpointToken

__all__ = ["Client", "RawClient", "make_client"]

T = TypeVar("T")
DEFAULT_TIMEOUT_S: Final = 10.0
_REPLIES: Final = 16  # of one blocking call that Zenoh keeps until they are read: one a server


class RawClient(Endpoint):
    """Calls a service in CDR bytes under a type that need not be known. Thread-safe."""

    def __init__(self, node: NodeCore, service: str, type_name: str, type_hash: str, qos: QoSProfile) -> None:
        super().__init__(node, "SC", service, type_name, type_hash, qos)
        self._next_seq = itertools.count(1).__next__
        self._expressions = {self.token.type_hash: zenoh.KeyExpr(self.key)}
        if self.twin_hash:
            twin = DataKey(node.context.domain_id, self.topic, type_name, self.twin_hash)
            self._expressions[self.twin_hash] = zenoh.KeyExpr(str(twin))
        self._lock = threading.Lock()
        self._calls: set[PendingCall] = set()
        self._servers: dict[str, str] = {}  # tokens and their hashes: so that no call has to search the graph
        self._replies = CallFutures(self.topic)
        self.on_close(self._replies.close)
        self.on_close(self._abandon)
        self.on_close(node.graph.on_token(self._on_token))
        with self._lock:
            self._servers.update((str(token), token.type_hash) for token in node.graph.tokens() if self._serves(token))
        self.announce()

    # -- who serves ------------------------------------------------------------------------------------------------

    def service_is_ready(self) -> bool:
        """Whether a server of this name, type and hash is in the graph."""
        return any(
            server.type_name == self.type_name and server.type_hash in self._expressions
            for server in self.node.graph.endpoints(self.topic, "SS")
        )

    def wait_for_service(self, timeout_s: float = DEFAULT_TIMEOUT_S) -> bool:
        """Wait until a server is there; False when none is in time."""
        return self.node.graph.wait_for(self.service_is_ready, timeout_s)

    def _serves(self, token: Token) -> TypeGuard[EndpointToken]:
        return (
            isinstance(token, EndpointToken)
            and (token.kind, token.topic, token.type_name) == ("SS", self.topic, self.type_name)
            and token.type_hash in self._expressions
        )

    def _expression(self) -> zenoh.KeyExpr:
        """The key of our own kind of servers, unless all are of the other kind: Humble's, or those that are not."""
        own, hashes = self.token.type_hash, set(self._servers.values())
        return self._expressions[own if own in hashes or not hashes else hashes.pop()]

    def _on_token(self, token: Token, alive: bool) -> None:
        """A server came or went; with the last one every call in flight ends."""
        if not self._serves(token):
            return
        with self._lock:
            if alive:
                self._servers[str(token)] = token.type_hash
                return
            self._servers.pop(str(token), None)
            lost = [] if self._servers else list(self._calls)
        for call in lost:
            call.fail(call.lost(f"the server of {self.topic} went away before it answered"))

    def _abandon(self) -> None:
        for call in list(self._calls):
            call.fail(ClosedError(f"the client of {self.topic} was closed"))

    # -- calls -----------------------------------------------------------------------------------------------------

    def call(self, request: Any, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
        """Send the request, block for the response; from any thread, also from a callback.

        UnavailableError at once when there is no server, or when it dies; TimeoutError_ when none answers in time;
        PeerError when it refuses; UsageError where the server would have to run on this very thread.
        """
        self.check_can_wait()
        payload = self._request_bytes(request)
        call = self._start(timeout_s)
        # Straight from Zenoh's channel: a callback on its thread would cost a hand-over more.
        replies = self._get(call, payload, timeout_s, zenoh.handlers.FifoChannel(_REPLIES))
        return self._response(call.read(replies))

    async def call_async(self, request: Any, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
        """The same for coroutines; cancelling the task cancels the call."""
        return self._response(await self._send(self._request_bytes(request), timeout_s).wait_async())

    def call_future(self, request: Any, timeout_s: float = DEFAULT_TIMEOUT_S) -> Future[Any]:
        """The same as a future, which can be cancelled; its callbacks run on a thread of this client."""
        call = self._send(self._request_bytes(request), timeout_s)
        future = CallFuture(call, self._response)
        self._replies.watch(future)
        call.when_finished(lambda: self._replies.put(future))
        return future

    def begin(
        self,
        request: Any,
        convert: Callable[[Any], T],
        timeout_s: float | None = DEFAULT_TIMEOUT_S,
        *,
        lost: type[UnavailableError] = UnavailableError,
    ) -> Reply[T]:
        """Send the request; the reply can be awaited or waited for. None as the timeout is as long as it takes.

        `lost` is the error where the server goes before it answers.
        """
        call = self._send(self._request_bytes(request), FOREVER_S if timeout_s is None else timeout_s, lost)
        return Reply(call, lambda data: convert(self._response(data)), self.check_can_wait)

    def check_can_wait(self) -> None:
        """UsageError when this thread runs the executor that would have to answer, so that it would wait for itself."""
        node = self.node
        if not node.ingress.owner.is_mine:
            return
        with self._lock:
            own = f"@ros2_lv/{node.context.domain_id}/{node.context.zid}/"
            waits = bool(self._servers) and all(token.startswith(own) for token in self._servers)
        if waits:
            raise UsageError(
                f"{self.topic} is served by the executor that runs this callback: it would wait for itself; "
                "use `await client.call_async(...)` in an `async def`, or another thread"
            )

    def _request_bytes(self, request: Any) -> bytes:
        if not isinstance(request, bytes | bytearray | memoryview):
            raise FieldError(f"{self.topic} is called in CDR bytes here, not with {type(request).__name__}")
        return bytes(request)

    def _response(self, data: bytes) -> Any:
        return data

    def _send(self, payload: bytes, timeout_s: float, lost: type[UnavailableError] = UnavailableError) -> PendingCall:
        call = self._start(timeout_s, lost)
        answers = zenoh.handlers.Callback(call.take, call.finish, indirect=False)
        self._get(call, payload, timeout_s + GRACE_S, answers)
        return call

    def _start(self, timeout_s: float, lost: type[UnavailableError] = UnavailableError) -> PendingCall:
        """A new call; an error at once where it makes no sense."""
        if self.closed:
            raise ClosedError(f"the client of {self.topic} was closed")
        if not 0 < timeout_s <= FOREVER_S:
            raise UsageError(f"a call needs a timeout of more than 0 and at most {FOREVER_S:g} s, not {timeout_s}")
        if not self._servers and not self.service_is_ready():
            raise lost(f"no server of {self.topic} with type {self.type_name} is in the graph")
        return PendingCall(self.topic, self._next_seq(), self.gid, timeout_s, lost)

    def _get(self, call: PendingCall, payload: bytes, timeout_s: float, handler: Any) -> Any:
        """Send the query; what Zenoh makes of the handler."""
        self._calls.add(call)
        call.when_finished(lambda: self._calls.discard(call))
        try:
            return self.node.context.session.check_open().get(
                self._expression(),
                handler,
                target=zenoh.QueryTarget.ALL_COMPLETE,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=timeout_s,
                payload=payload,
                attachment=pack_attachment(call.seq, self.node.clock.wall_ns(), self.gid),
                cancellation_token=call.token,
            )
        except zenoh.ZError as error:
            self._calls.discard(call)
            raise ClosedError(f"call of {self.topic}: {error}") from None


class Client(RawClient):
    """Calls a service with its request class and returns its response class."""

    def __init__(
        self, node: NodeCore, service: type[Any], name: str, *, request: Codec, response: Codec, qos: QoSProfile
    ) -> None:
        remember_class(service)
        self._codecs = request, response
        self.service_type = service
        super().__init__(node, name, service.__metaros_name__, service.__metaros_hash__, qos)

    def _request_bytes(self, request: Any) -> bytes:
        if not isinstance(request, self.service_type.Request):
            raise FieldError(f"{self.topic} takes {self.type_name}.Request, not {type(request).__name__}")
        return self._codecs[0].encode(request)

    def _response(self, data: bytes) -> Any:
        return self._codecs[1].decode(data)


def make_client(node: NodeCore, service_type: type[Any], name: str, qos: QoSProfile | int = qos_services) -> Client:
    """The client of a service class."""
    request, response = codec(service_type.Request), codec(service_type.Response)
    return Client(node, service_type, name, request=request, response=response, qos=as_qos(qos))
