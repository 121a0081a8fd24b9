"""Service servers: requests wait in a mailbox, the executor serves them, answers may come later and from any thread."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

import zenoh

from metaros.cdr import Codec
from metaros.errors import MetarosError, PeerError
from metaros.executor import CallbackGroup, Mailbox
from metaros.idl import remember_class
from metaros.limits import LIMITS
from metaros.node.core import NodeCore
from metaros.node.endpoint import Endpoint
from metaros.node.info import takes
from metaros.wire import Attachment, QoSProfile, pack_attachment, parse_attachment

__all__ = ["PendingRequest", "Responder", "Service"]

_log = logging.getLogger("metaros.node")
_OVERHEAD_BYTES = 512  # what Zenoh and Python keep beside a request's payload


def query_bytes(query: zenoh.Query) -> int:
    """What a waiting request weighs; 0 where another thread has taken and answered it meanwhile."""
    try:
        payload = query.payload
    except zenoh.ZError:
        return 0
    return _OVERHEAD_BYTES + (0 if payload is None else len(payload))


class PendingRequest:
    """A request that waits for its answer. Only the first of `answer`, `refuse` and `drop` counts."""

    __slots__ = ("_call", "_query", "_responder")

    def __init__(self, responder: Responder, query: zenoh.Query, call: Attachment) -> None:
        self._responder = responder
        self._call = call
        self._query = [query]  # taken out by whoever ends it: popping is atomic

    @property
    def key(self) -> tuple[bytes, int]:
        """Who asks, and for the how-manieth time."""
        return self._call.gid, self._call.seq

    def answer(self, response: Any) -> None:
        """Send the response, or its CDR; FieldError when its fields do not fit, which leaves the client waiting."""
        data = response if isinstance(response, bytes) else self._responder.encode(response)
        query = self._take()
        if query is not None:
            self._responder.reply(query, self._call, data)

    def refuse(self, text: str) -> None:
        """Send an error instead."""
        query = self._take()
        if query is not None:
            refuse(query, text)

    def drop(self) -> None:
        """End it without a word: the client learns that nobody answers any more."""
        query = self._take()
        if query is not None:
            query.drop()  # type: ignore[no-untyped-call]

    def _take(self) -> zenoh.Query | None:
        try:
            query = self._query.pop()
        except IndexError:
            return None
        self._responder.forget(self)
        return query


def refuse(query: zenoh.Query, text: str) -> None:
    """Answer a query with an error."""
    with suppress(zenoh.ZError):  # the client or the session is gone
        query.reply_err(text.encode())
    query.drop()  # type: ignore[no-untyped-call]


class Responder(Endpoint):
    """A service server whose `serve(request, waiting)` answers when it pleases, in rmw_zenoh's terms.

    At most `backlog` requests, of LIMITS.ingress_bytes together, wait for the executor; a newer one pushes out the
    oldest, which is counted in `dropped` and ends for its client with an `unavailable` error.
    """

    def __init__(
        self,
        node: NodeCore,
        service: type[Any],
        name: str,
        serve: Callable[[Any, PendingRequest], Awaitable[None] | None],
        *,
        request: Codec,
        response: Codec,
        qos: QoSProfile,
        backlog: int = LIMITS.service_backlog,
        group: CallbackGroup | None = None,
    ) -> None:
        remember_class(service)
        super().__init__(node, "SS", name, service.__metaros_name__, service.__metaros_hash__, qos)
        self._serve = serve
        self._decode, self.encode = request.decode, response.encode
        self._waiting: dict[tuple[bytes, int], PendingRequest] = {}
        self.malformed = 0
        self._mailbox = Mailbox(
            self._handle,
            owner=node,
            depth=backlog,
            limit_bytes=LIMITS.ingress_bytes,
            size_of=query_bytes,
            group=group,
        )
        sink = zenoh.handlers.Callback(node.ingress.put_to(self._mailbox), indirect=False)
        self.on_close(self._drop_all)
        self.on_close(self._mailbox.clear)

        def serve_on(key: str) -> None:
            queryable = node.context.session.check_open().declare_queryable(key, sink, complete=True)
            self.on_close(queryable.undeclare)

        serve_on(self.key)
        self.speak_both(serve_on, with_the_first=True)
        self.announce()

    @property
    def dropped(self) -> int:
        """Requests that were pushed out by newer ones before they were served."""
        return self._mailbox.dropped

    @property
    def waiting(self) -> int:
        """Clients whose requests are being served."""
        return len(self._waiting)

    def forget(self, waiting: PendingRequest) -> None:
        """It was answered."""
        self._waiting.pop(waiting.key, None)

    def reply(self, query: zenoh.Query, call: Attachment, data: bytes) -> None:
        """Reply on the key that was asked, with the request's sequence number and GID, and the time of now."""
        with suppress(zenoh.ZError):  # the client or the session is gone
            query.reply(
                query.key_expr, data, attachment=pack_attachment(call.seq, self.node.context.clock.wall_ns(), call.gid)
            )
        query.drop()  # type: ignore[no-untyped-call]

    def _handle(self, query: zenoh.Query) -> Awaitable[None] | None:
        try:
            if query.payload is None or query.attachment is None:
                raise PeerError("a request needs a payload and an attachment")
            call = parse_attachment(query.attachment.to_bytes())
            if (call.gid, call.seq) in self._waiting:
                raise PeerError(f"request {call.seq} of client {call.gid.hex()} is being served already")
            request = self._decode(query.payload.to_bytes())
        except PeerError as error:
            self.malformed += 1
            self.report_once(error.code, f"refused a request: {error.code}: {error}")
            refuse(query, f"{error.code}: {error}")
            return None
        waiting = PendingRequest(self, query, call)
        self._waiting[waiting.key] = waiting
        return self._serve(request, waiting)

    def _drop_all(self) -> None:
        for waiting in list(self._waiting.values()):
            waiting.drop()


class Service(Responder):
    """Answers each request with what `callback(request, response)` returns, or with the response it filled in."""

    def __init__(
        self,
        node: NodeCore,
        service: type[Any],
        name: str,
        callback: Callable[..., Any],
        *,
        request: Codec,
        response: Codec,
        qos: QoSProfile,
        backlog: int = LIMITS.service_backlog,
        group: CallbackGroup | None = None,
    ) -> None:
        self.callback = callback
        self._response_type = service.Response
        takes(callback, 2)
        if inspect.iscoroutinefunction(callback):
            node.ingress.async_work = True
        options: Any = {"request": request, "response": response, "qos": qos, "backlog": backlog, "group": group}
        super().__init__(node, service, name, self._call_back, **options)

    def _call_back(self, request: Any, waiting: PendingRequest) -> Awaitable[None] | None:
        response = self._response_type()
        try:
            result = self.callback(request, response)
        except Exception as error:
            self._failed(waiting, error)
            return None
        if inspect.isawaitable(result):
            return self._answer_later(waiting, response, result)
        self._answer(waiting, response if result is None else result)
        return None

    async def _answer_later(self, waiting: PendingRequest, response: Any, result: Awaitable[Any]) -> None:
        try:
            answer = await result
        except Exception as error:
            self._failed(waiting, error)
            return
        except BaseException:  # the executor was shut down under it
            waiting.drop()
            raise
        self._answer(waiting, response if answer is None else answer)

    def _answer(self, waiting: PendingRequest, response: Any) -> None:
        try:
            waiting.answer(response)
        except MetarosError as error:
            self._failed(waiting, error)

    def _failed(self, waiting: PendingRequest, error: Exception) -> None:
        _log.error("the callback of service %s failed", self.topic, exc_info=error)
        waiting.refuse(f"{type(error).__name__}: {error}")
