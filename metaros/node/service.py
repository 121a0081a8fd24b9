"""Service servers: requests wait in a mailbox, the executor answers them, in rmw_zenoh's terms."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import zenoh

from metaros.cdr import Codec
from metaros.errors import MetarosError, PeerError
from metaros.executor import Mailbox
from metaros.limits import LIMITS
from metaros.node.endpoint import Endpoint
from metaros.node.info import takes
from metaros.wire import Attachment, QoSProfile, pack_attachment, parse_attachment

if TYPE_CHECKING:
    from metaros.node.node import Node

__all__ = ["Service"]

_log = logging.getLogger("metaros.node")


def query_bytes(query: zenoh.Query) -> int:
    """What a waiting request weighs."""
    return 0 if query.payload is None else len(query.payload)


class Service(Endpoint):
    """Answers each request with what `callback(request, response)` returns, or with the response it filled in.

    At most `qos.depth` requests wait; a newer one pushes out the oldest, which is counted in `dropped`.
    """

    def __init__(
        self,
        node: Node,
        service: type[Any],
        name: str,
        callback: Callable[..., Any],
        *,
        request: Codec,
        response: Codec,
        qos: QoSProfile,
    ) -> None:
        super().__init__(node, "SS", name, service.__metaros_name__, service.__metaros_hash__, qos)
        self.callback = callback
        self._response_type = service.Response
        self._request, self._response = request, response
        self.malformed = 0
        takes(callback, 2)
        if inspect.iscoroutinefunction(callback):
            node.ingress.async_work = True
        self._mailbox = Mailbox(
            self._handle, owner=node, depth=qos.depth, limit_bytes=LIMITS.ingress_bytes, size_of=query_bytes
        )
        sink = zenoh.handlers.Callback(node.ingress.put_to(self._mailbox), indirect=False)
        queryable = node.context.session.check_open().declare_queryable(self.key, sink, complete=True)
        self.on_close(self._mailbox.clear)
        self.on_close(queryable.undeclare)
        self.announce()

    @property
    def dropped(self) -> int:
        """Requests that were pushed out by newer ones before they were served."""
        return self._mailbox.dropped

    def _handle(self, query: zenoh.Query) -> Awaitable[None] | None:
        try:
            if query.payload is None or query.attachment is None:
                raise PeerError("a request needs a payload and an attachment")
            call = parse_attachment(query.attachment.to_bytes())
            request = self._request.decode(query.payload.to_bytes())
        except PeerError as error:
            self.malformed += 1
            self.report_once(error.code, f"refused a request: {error.code}: {error}")
            self._refuse(query, f"{error.code}: {error}")
            return None
        response = self._response_type()
        try:
            result = self.callback(request, response)
        except Exception as error:
            self._failed(query, error)
            return None
        if inspect.isawaitable(result):
            return self._answer_later(query, call, response, result)
        self._answer(query, call, response if result is None else result)
        return None

    async def _answer_later(self, query: zenoh.Query, call: Attachment, response: Any, result: Awaitable[Any]) -> None:
        try:
            answer = await result
        except Exception as error:
            self._failed(query, error)
            return
        self._answer(query, call, response if answer is None else answer)

    def _answer(self, query: zenoh.Query, call: Attachment, response: Any) -> None:
        """Reply on the declared key with the request's sequence number and GID, and the time of now."""
        try:
            data = self._response.encode(response)
        except MetarosError as error:
            self._failed(query, error)
            return
        with suppress(zenoh.ZError):  # the client or the session is gone
            query.reply(self.key, data, attachment=pack_attachment(call.seq, self.node.clock.wall_ns(), call.gid))
        query.drop()  # type: ignore[no-untyped-call]

    def _failed(self, query: zenoh.Query, error: Exception) -> None:
        _log.error("the callback of service %s failed", self.topic, exc_info=error)
        self._refuse(query, f"{type(error).__name__}: {error}")

    def _refuse(self, query: zenoh.Query, text: str) -> None:
        with suppress(zenoh.ZError):
            query.reply_err(text.encode())
        query.drop()  # type: ignore[no-untyped-call]
