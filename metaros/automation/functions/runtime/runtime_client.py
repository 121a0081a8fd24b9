"""The worker's own side of the Runtime API, in plain Python: for where AWS's client does not install.

The handler contract is AWS Lambda's: `module.function` or `folder/module.function`, JSON or bytes out, exceptions as
error documents. One thing more: a handler that is a generator, or returns an iterator of text or bytes, streams its
answer. Two things less: of a `Decimal` what a float can tell is sent, and a named tuple is sent as a list.
Imports nothing slow: a worker waits for it at its start.
"""

from __future__ import annotations

import base64
import importlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from decimal import Decimal
from typing import Any

from metaros.automation.functions.runtime.client_context import context_of
from metaros.automation.functions.runtime.client_errors import Failure, Fault
from metaros.automation.functions.runtime.client_http import Connection, RuntimeApiError
from metaros.automation.functions.runtime.client_logs import Logged, LogSink, set_up_logging

__all__ = ["find_handler", "main"]

BASE = "/2018-06-01/runtime/"
_ERROR_TYPE = "Lambda-Runtime-Function-Error-Type"
Handler = Callable[[Any, Any], Any]


def find_handler(name: str) -> Handler:
    """The function that `name` says, its module imported.

    Raises:
        Fault: there is none, or its module cannot be imported; `kind` is AWS's name for which.
    """
    module_name, dot, function = name.rpartition(".")
    if not dot:
        raise Fault("Runtime.MalformedHandlerName", f"Bad handler '{name}': it is not MODULE.FUNCTION")
    if module_name.split(".")[0] in sys.builtin_module_names:
        message = f"Cannot use built-in module {module_name} as a handler module"
        raise Fault("Runtime.BuiltInModuleConflict", message)
    try:
        module = importlib.import_module(module_name.replace("/", "."))
    except ImportError as error:
        raise Fault("Runtime.ImportModuleError", f"Unable to import module '{module_name}': {error}") from error
    except SyntaxError as error:
        trace = [f'  File "{error.filename}" Line {error.lineno}\n    {error.text}']
        message = f"Syntax error in module '{module_name}': {error}"
        raise Fault("Runtime.UserCodeSyntaxError", message, trace=trace) from error
    try:
        handler: Handler = getattr(module, function)
    except AttributeError as error:
        message = f"Handler '{function}' missing on module '{module_name}'"
        raise Fault("Runtime.HandlerNotFound", message) from error
    return handler


def main(handler: str, api: str) -> None:
    """Serve calls until the other side is gone; `api` is `host:port`."""
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(line_buffering=True, write_through=True)  # type: ignore[union-attr]
    sink = LogSink()
    set_up_logging(sink)
    connection = Connection(api)
    try:
        function = find_handler(handler)
    except Exception as error:
        failure = Failure(error)
        sink.write(failure.text, level=40)
        connection.post(BASE + "init/error", json.dumps(failure.document).encode(), {_ERROR_TYPE: failure.kind})
        sys.exit(1)
    while True:
        _serve(connection, function, sink)


def _serve(connection: Connection, function: Handler, sink: LogSink) -> None:
    """One call, from the request for it to its answer."""
    headers, body = connection.get(BASE + "invocation/next")
    request_id = Logged.request_id = headers.get("lambda-runtime-aws-request-id", "")
    target = f"{BASE}invocation/{request_id}/"
    _set_trace(headers.get("lambda-runtime-trace-id", ""))
    try:
        result = function(_event_of(body, headers.get("content-type", "")), context_of(headers))
        pieces: Iterator[bytes] | None = None
        if isinstance(result, Iterator):
            pieces = _pieces_of(result)
            first = next(pieces, b"")  # what fails before the first piece fails as any call does
        else:
            payload, content_type = _payload_of(result)
    except Exception as error:
        _fail(connection, target, Failure(error, request_id=request_id), sink)
        return
    if pieces is None:
        connection.post(target + "response", payload, {"Content-Type": content_type}, refused_ok=True)
    else:
        _stream(connection, target, first, pieces, sink)


def _set_trace(trace_id: str) -> None:
    if trace_id:
        os.environ["_X_AMZN_TRACE_ID"] = trace_id
    elif "_X_AMZN_TRACE_ID" in os.environ:
        del os.environ["_X_AMZN_TRACE_ID"]


def _event_of(body: bytes, content_type: str) -> Any:
    if content_type != "application/json":
        return body
    try:
        return json.loads(body)
    except (ValueError, RecursionError) as error:
        raise Fault("Runtime.UnmarshalError", f"Unable to unmarshal input: {error}") from error


def _plain(value: object) -> object:
    if isinstance(value, Decimal):
        whole = value.is_finite() and value == value.to_integral_value()
        return int(value) if whole else float(value)
    raise TypeError(f"Object of type {type(value).__name__} is not JSON serializable")


def _payload_of(result: Any) -> tuple[bytes, str]:
    if isinstance(result, bytes):
        return result, "application/unknown"
    try:
        return json.dumps(result, default=_plain).encode(), "application/json"
    except Exception as error:
        raise Fault("Runtime.MarshalError", f"Unable to marshal response: {error}") from error


def _pieces_of(result: Iterator[Any]) -> Iterator[bytes]:
    for piece in result:
        if isinstance(piece, str):
            yield piece.encode()
        elif isinstance(piece, (bytes, bytearray, memoryview)):
            yield bytes(piece)
        else:
            kind = type(piece).__name__
            raise Fault("Runtime.MarshalError", f"Unable to marshal response: a piece is {kind}, not text or bytes")


def _stream(connection: Connection, target: str, first: bytes, pieces: Iterator[bytes], sink: LogSink) -> None:
    connection.begin_chunks(target + "response", {"Content-Type": "application/octet-stream"})
    trailers: dict[str, str] = {}
    try:
        connection.chunk(first)
        for piece in pieces:
            connection.chunk(piece)
    except RuntimeApiError:
        raise
    except Exception as error:
        failure = Failure(error, request_id=Logged.request_id)
        sink.write(failure.text, level=40)
        document = base64.b64encode(json.dumps(failure.document).encode()).decode()
        trailers = {_ERROR_TYPE: failure.kind, "Lambda-Runtime-Function-Error-Body": document}
    connection.end_chunks(trailers)


def _fail(connection: Connection, target: str, failure: Failure, sink: LogSink) -> None:
    sink.write(failure.text, level=40)
    headers = {_ERROR_TYPE: failure.kind, "Lambda-Runtime-Function-XRay-Error-Cause": failure.cause}
    connection.post(target + "error", json.dumps(failure.document).encode(), headers, refused_ok=True)


if __name__ == "__main__":
    main(sys.argv[1], os.environ["AWS_LAMBDA_RUNTIME_API"])
