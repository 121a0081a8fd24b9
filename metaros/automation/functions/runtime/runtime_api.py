"""The Runtime API of one worker: what may be asked in which state, and what is answered.

One listener serves one worker, so nobody has to say who it is. The worker's owner is notified of what it did and gives
it calls; here is no clock, no process and no queue.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import enum
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, cast

from metaros.automation.functions.calls import Invocation
from metaros.automation.functions.response_stream import ResponseStream
from metaros.automation.functions.runtime.runtime_http import BadRequestError, Request, RequestReader, reply
from metaros.limits import LIMITS, Limits

__all__ = ["Answer", "Owner", "RuntimeApi", "event_head"]

PREFIX = b"/2018-06-01/"
NEXT = PREFIX + b"runtime/invocation/next"
INVOCATION = PREFIX + b"runtime/invocation/"
INIT_ERROR = PREFIX + b"runtime/init/error"
STREAMING = b"streaming"
TOO_LARGE = "Function.ResponseSizeTooLarge"
_MODE = b"lambda-runtime-function-response-mode"
_ERROR_TYPE = b"lambda-runtime-function-error-type"
_ERROR_BODY = b"lambda-runtime-function-error-body"
_ACCEPTED = reply(202, b'{"status":"OK"}\n')
_PONG = reply(200, b"pong", content_type=b"text/plain")
_PARSED_BYTES = 65_536
_NAMED_TYPE = re.compile(rb'"errorType": ?"([^"\\]{1,256})"')
_CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"

# What is not offered, each by its name. Runtimes and extensions take a 202 with a NotSupported body, as AWS's own
# emulator gives it, for "go on without".
_NOT_OFFERED = {
    b"/2020-08-15/logs": (202, "Logs.NotSupported", "the Logs API is not offered here"),
    b"/2022-07-01/telemetry": (202, "Telemetry.NotSupported", "the Telemetry API is not offered here"),
    b"/2020-01-01/extension/": (403, "Extension.NotSupported", "extensions are not run here"),
    PREFIX + b"runtime/restore/": (403, "InvalidStateTransition", "workers are not started from snapshots here"),
}


@dataclass(frozen=True, slots=True)
class Answer:
    """What a worker said of its call; `error_type` is "" where the handler returned."""

    body: bytes
    error_type: str = ""
    content_type: str = "application/json"


class Owner(Protocol):
    """Who owns the worker."""

    def on_ready(self) -> None:
        """It asks for a call: `give` one."""

    def on_answer(self, answer: Answer) -> None:
        """It is done with its call."""

    def on_init_error(self, answer: Answer) -> None:
        """It will never ask for one."""

    def on_lost(self) -> None:
        """It does not wait for a call any more."""


class State(enum.Enum):
    """Where a worker is."""

    INIT = enum.auto()  # has asked for nothing yet
    READY = enum.auto()  # waits for a call
    BUSY = enum.auto()  # has one
    ANSWERED = enum.auto()  # is done with it and has not asked for the next
    FAILED = enum.auto()  # has reported an error of its init


def event_head(call: Invocation, *, arn: str, deadline_ms: int) -> bytes:
    """The head of the answer that is a call; the caller has checked that no value can break out of its header."""
    optional = ""
    if call.trace_id:
        optional = f"Lambda-Runtime-Trace-Id: {call.trace_id}\r\n"
    if call.client_context:
        optional += f"Lambda-Runtime-Client-Context: {call.client_context}\r\n"
    return (
        "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n"
        f"Lambda-Runtime-Aws-Request-Id: {call.request_id}\r\n"
        f"Lambda-Runtime-Deadline-Ms: {deadline_ms}\r\n"
        f"Lambda-Runtime-Invoked-Function-Arn: {arn}\r\n"
        f"{optional}Content-Length: {len(call.payload)}\r\n\r\n"
    ).encode()


def _refusal(status: int, error_type: str, message: str) -> bytes:
    return reply(status, json.dumps({"errorMessage": message, "errorType": error_type}).encode())


class RuntimeApi:
    """Create `connection` for each that the worker opens; `close` ends them all."""

    def __init__(self, owner: Owner, *, limits: Limits = LIMITS) -> None:
        self._owner = owner
        self.limits = limits
        self.state = State.INIT
        self._connections: set[_Connection] = set()
        self._waiting: _Connection | None = None  # has asked for the next call
        self._response = self._error = b""  # the targets of the call's two ends
        self._stream: ResponseStream | None = None
        self._streaming: _Connection | None = None  # the answer comes by it, piece by piece
        self._answering: _Connection | None = None  # the answer comes by it: no other's body is kept

    def connection(self) -> asyncio.Protocol:
        """For `create_server`."""
        return _Connection(self)

    @property
    def waits(self) -> bool:
        """Whether a call can be given."""
        return self._waiting is not None

    def give(self, head: bytes, call: Invocation, *, stream: ResponseStream | None = None) -> None:
        """Answer the worker's request for a call; it must wait for one. `stream` takes a streamed answer's pieces."""
        waiting, self._waiting = self._waiting, None
        assert waiting is not None, "the worker waits for no call"
        self.state = State.BUSY
        base = INVOCATION + call.request_id.encode()
        self._response, self._error = base + b"/response", base + b"/error"
        self._stream = stream
        if len(call.payload) < 65_536:
            waiting.transport.write(head + call.payload)
        else:
            waiting.transport.writelines((head, call.payload))

    def close(self) -> None:
        """Break off every connection."""
        for connection in list(self._connections):
            connection.transport.abort()

    # Callbacks of connections.

    def joined(self, connection: _Connection) -> None:
        """The worker opened one; over the limit it is closed."""
        if len(self._connections) >= self.limits.function_connections:
            connection.transport.abort()
        self._connections.add(connection)

    def left(self, connection: _Connection) -> None:
        """One is gone."""
        self._connections.discard(connection)
        if connection is self._waiting:
            self._waiting = None
            self._owner.on_lost()
        if connection is self._streaming:
            self._done(Answer(_document("the answer ended before it was whole"), "Runtime.TruncatedResponse"))
        if connection is self._answering:
            self._answering = None

    def begun(self, connection: _Connection, request: Request) -> Callable[[bytes], None] | None:
        """A request's head came: who takes the pieces of its body."""
        if request.headers.get(_MODE) == STREAMING and self._stream is not None and self._expects(request.target):
            self._streaming = connection
            self._stream.begin(cast("asyncio.ReadTransport", connection.transport))
            return self._stream.feed
        if not self._ends_call(request.target) or self._answering not in (None, connection):
            return None if self.state is State.INIT and request.target == INIT_ERROR else _drop
        self._answering = connection
        return None

    def handle(self, connection: _Connection, request: Request) -> None:
        """Answer a whole request."""
        if request.target == NEXT and request.method == b"GET":
            self._next(connection)
        elif request.method == b"POST" and request.target.startswith(INVOCATION):
            self._end_of_call(connection, request)
        else:
            connection.transport.write(self._other(request))

    def _next(self, connection: _Connection) -> None:
        if self.state in (State.BUSY, State.FAILED) or self._waiting is not None:
            connection.transport.write(self._wrong_state())
            return
        self.state = State.READY
        self._waiting = connection
        self._owner.on_ready()

    def _expects(self, target: bytes) -> bool:
        return self.state is State.BUSY and target == self._response

    def _ends_call(self, target: bytes) -> bool:
        return self.state is State.BUSY and target in (self._response, self._error)

    def _end_of_call(self, connection: _Connection, request: Request) -> None:
        if self._streaming is connection:
            self._streaming = None
            self._end_of_stream(connection, request)
            return
        failed = request.target == self._error
        if not failed and request.target != self._response:
            connection.transport.write(_refusal(400, "InvalidRequestID", "this is not the id of the worker's call"))
        elif self.state is not State.BUSY or connection is not self._answering:
            connection.transport.write(self._wrong_state())
        elif not failed and request.headers.get(_MODE, STREAMING) != STREAMING:
            message = "the response mode is not `streaming`"
            connection.transport.write(_refusal(400, "Runtime.InvalidResponseModeHeader", message))
        elif request.cut:
            message = f"Response payload size exceeded maximum allowed payload size ({self._most} bytes)."
            connection.transport.write(_refusal(413, TOO_LARGE, message))
            self._done(Answer(_document(message, TOO_LARGE), TOO_LARGE))
        else:
            connection.transport.write(_ACCEPTED)
            self._done(_error_of(request) if failed else _answer_of(request))

    @property
    def _most(self) -> int:
        return self.limits.function_response_bytes

    def _end_of_stream(self, connection: _Connection, request: Request) -> None:
        assert self._stream is not None
        if self._stream.too_large:
            message = f"A streamed response is over {self.limits.function_stream_bytes} bytes."
            connection.transport.write(_refusal(413, TOO_LARGE, message))
            self._done(Answer(_document(message, TOO_LARGE), TOO_LARGE))
        else:
            connection.transport.write(_ACCEPTED)
            self._done(_answer_of(request))

    def _done(self, answer: Answer) -> None:
        self._stream = self._streaming = self._answering = None
        self.state = State.ANSWERED
        self._owner.on_answer(answer)

    def _other(self, request: Request) -> bytes:
        if request.target == PREFIX + b"ping":
            return _PONG
        if request.target == INIT_ERROR and request.method == b"POST":
            if self.state is not State.INIT:
                return self._wrong_state()
            self.state = State.FAILED
            self._owner.on_init_error(_error_of(request))
            return _ACCEPTED
        for prefix, (status, error_type, message) in _NOT_OFFERED.items():
            if request.target.startswith(prefix):
                return _refusal(status, error_type, message)
        return _refusal(404, "NotFound", "no such call of the Runtime API")

    def _wrong_state(self) -> bytes:
        return _refusal(403, "InvalidStateTransition", f"not while the worker is {self.state.name.lower()}")


def _drop(piece: bytes) -> None:
    """Of a body that nobody asked for."""


def _document(message: str, error_type: str = "Runtime.TruncatedResponse") -> bytes:
    return json.dumps({"errorMessage": message, "errorType": error_type}).encode()


def _word(value: bytes) -> str:
    """The type of an error, from outside."""
    return value[:256].decode("utf-8", "replace")


def _error_of(request: Request) -> Answer:
    return Answer(request.body, _word(request.headers.get(_ERROR_TYPE, b"")) or _type_of(request.body))


def _type_of(document: bytes) -> str:
    """awslambdaric names the type only in the document. A large one is not parsed: it would hold up all else."""
    if len(document) > _PARSED_BYTES:
        named = _NAMED_TYPE.search(document, 0, _PARSED_BYTES) or _NAMED_TYPE.search(document[-_PARSED_BYTES:])
        return _word(named[1]) if named else "Runtime.Unknown"
    try:
        found = json.loads(document).get("errorType")
    except (ValueError, AttributeError, RecursionError):
        found = None
    return found[:256] if isinstance(found, str) and found else "Runtime.Unknown"


def _answer_of(request: Request) -> Answer:
    error_type = request.trailers.get(_ERROR_TYPE)
    if error_type is None:
        content_type = request.headers.get(b"content-type", b"application/json")
        return Answer(request.body, content_type=content_type.decode("latin-1"))
    try:
        document = base64.b64decode(request.trailers.get(_ERROR_BODY, b""), validate=True)
    except binascii.Error:
        document = b""
    return Answer(document or _document("the handler failed in mid-stream", _word(error_type)), _word(error_type))


class _Connection(asyncio.Protocol):
    """One connection of the worker."""

    transport: asyncio.Transport

    def __init__(self, api: RuntimeApi) -> None:
        self._api = api
        self._reader = RequestReader(
            begun=lambda request: api.begun(self, request),
            done=lambda request: api.handle(self, request),
            go_on=lambda: self.transport.write(_CONTINUE),
            limits=api.limits,
        )

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast(asyncio.Transport, transport)
        self._api.joined(self)

    def data_received(self, data: bytes) -> None:
        try:
            self._reader.feed(data)
        except BadRequestError as error:
            self.transport.write(_refusal(400, "BadRequest", str(error)))
            self.transport.close()

    def pause_writing(self) -> None:
        """It does not read what it is answered: it asks nothing more until it does."""
        self.transport.pause_reading()

    def resume_writing(self) -> None:
        """It does."""
        self.transport.resume_reading()

    def connection_lost(self, exc: Exception | None) -> None:
        self._api.left(self)
