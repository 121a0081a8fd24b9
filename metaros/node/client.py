"""Service clients: blocking and async calls, typed or in CDR bytes."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import zenoh

from metaros.cdr import Codec
from metaros.errors import ClosedError, FieldError, PeerError, TimeoutError_, UnavailableError
from metaros.node.endpoint import Endpoint
from metaros.wire import QoSProfile, pack_attachment, parse_attachment

if TYPE_CHECKING:
    from metaros.node.node import Node

__all__ = ["Client", "RawClient"]

DEFAULT_TIMEOUT_S: Final = 10.0
_GRACE_S: Final = 0.5  # Zenoh's own timeout ends a call; ours only guards against a session that died under it


class _Call:
    """The answers of one request; `done()` is called once, on a Zenoh thread."""

    def __init__(self, seq: int, gid: bytes, done: Callable[[], object]) -> None:
        self._seq, self._gid, self._done = seq, gid, done
        self.answer: bytes | None = None
        self.refusal: str | None = None
        self.finished = False

    def take(self, reply: zenoh.Reply) -> None:
        """Keep the first sound answer; an error only counts where no answer comes."""
        if reply.ok is None:
            text = b"" if reply.err is None else reply.err.payload.to_bytes()
            self.refusal = self.refusal or text.decode(errors="replace")
            return
        try:
            attachment = reply.ok.attachment
            sent = parse_attachment(b"" if attachment is None else attachment.to_bytes())
        except PeerError as error:
            self.refusal = f"{error.code}: {error}"
            return
        if self.answer is None and (sent.seq, sent.gid) == (self._seq, self._gid):
            self.answer = reply.ok.payload.to_bytes()
            self.finish()

    def finish(self) -> None:
        """The answer is there, or none will come."""
        if not self.finished:
            self.finished = True
            self._done()


class RawClient(Endpoint):
    """Calls a service in CDR bytes under a type that need not be known."""

    def __init__(self, node: Node, service: str, type_name: str, type_hash: str, qos: QoSProfile) -> None:
        super().__init__(node, "SC", service, type_name, type_hash, qos)
        self._next_seq = itertools.count(1).__next__
        self.announce()

    def service_is_ready(self) -> bool:
        """Whether a server of this name, type and hash is in the graph."""
        return any(
            (server.type_name, server.type_hash) == (self.type_name, self.type_hash)
            for server in self.node.graph.endpoints(self.topic, "SS")
        )

    def wait_for_service(self, timeout_s: float = DEFAULT_TIMEOUT_S) -> bool:
        """Wait until a server is there; False when none is in time."""
        return self.node.graph.wait_for(self.service_is_ready, timeout_s)

    def call(self, request: Any, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
        """Send the request, return the response.

        UnavailableError at once when there is no server, TimeoutError_ when none answers in time, PeerError when the
        server refuses. Do not call a service of the same executor from a plain callback: it would wait for itself.
        """
        arrived = threading.Event()
        call = self._send(self._request_bytes(request), timeout_s, arrived.set)
        arrived.wait(timeout_s + _GRACE_S)
        return self._response(self._outcome(call, timeout_s))

    async def call_async(self, request: Any, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
        """The same for coroutines."""
        loop, arrived = asyncio.get_running_loop(), asyncio.Event()

        def done() -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(arrived.set)

        call = self._send(self._request_bytes(request), timeout_s, done)
        try:
            async with asyncio.timeout(timeout_s + _GRACE_S):
                await arrived.wait()
        except TimeoutError:
            pass
        return self._response(self._outcome(call, timeout_s))

    def _request_bytes(self, request: Any) -> bytes:
        if not isinstance(request, bytes | bytearray | memoryview):
            raise FieldError(f"{self.topic} is called in CDR bytes here, not with {type(request).__name__}")
        return bytes(request)

    def _response(self, data: bytes) -> Any:
        return data

    def _send(self, payload: bytes, timeout_s: float, done: Callable[[], object]) -> _Call:
        if self.closed:
            raise ClosedError(f"the client of {self.topic} was closed")
        if not self.service_is_ready():
            raise UnavailableError(f"no server of {self.topic} with type {self.type_name} is in the graph")
        seq = self._next_seq()
        call = _Call(seq, self.gid, done)
        self.node.context.session.check_open().get(
            self.key,
            zenoh.handlers.Callback(call.take, call.finish, indirect=False),
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=timeout_s,
            payload=payload,
            attachment=pack_attachment(seq, self.node.clock.wall_ns(), self.gid),
        )
        return call

    def _outcome(self, call: _Call, timeout_s: float) -> bytes:
        if call.answer is not None:
            return call.answer
        if call.refusal and call.refusal != "Timeout":
            raise PeerError(f"{self.topic} refused the request: {call.refusal}")
        raise TimeoutError_(f"no answer from {self.topic} within {timeout_s:g} s")


class Client(RawClient):
    """Calls a service with its request class and returns its response class."""

    def __init__(
        self, node: Node, service: type[Any], name: str, *, request: Codec, response: Codec, qos: QoSProfile
    ) -> None:
        self._codecs = request, response
        self.service_type = service
        super().__init__(node, name, service.__metaros_name__, service.__metaros_hash__, qos)

    def _request_bytes(self, request: Any) -> bytes:
        if not isinstance(request, self.service_type.Request):
            raise FieldError(f"{self.topic} takes {self.type_name}.Request, not {type(request).__name__}")
        return self._codecs[0].encode(request)

    def _response(self, data: bytes) -> Any:
        return self._codecs[1].decode(data)
