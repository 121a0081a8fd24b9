"""The service Fleet on a server: the gate looks at a call's metadata before a byte of its message is read.

gRPC would take in the whole message first, from anybody. So every method is served as one that reads a stream, which
looks the same on the wire, and who is refused has sent no more than fits into HTTP/2's first window.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import aclosing
from typing import Any

import grpc
from google.protobuf.descriptor import MethodDescriptor
from google.protobuf.message import DecodeError

from gateway.api.grpc.authenticate import Context, Gate
from gateway.api.grpc.fleet import FleetService
from gateway.errors import InvalidRequestError, RequestTimeoutError
from metaros._proto import fleet_pb2
from metaros.limits import LIMITS

__all__ = ["add_fleet"]

Requests = AsyncIterator[Any]
_SERVICE = fleet_pb2.DESCRIPTOR.services_by_name["Fleet"]


def add_fleet(server: grpc.aio.Server, gate: Gate) -> None:
    """Serve every method of the description."""
    service = FleetService()
    handlers = {method.name: _handler(gate, service, method) for method in _SERVICE.methods}
    server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler(_SERVICE.full_name, handlers),))
    server.add_registered_method_handlers(_SERVICE.full_name, handlers)


def _handler(gate: Gate, service: FleetService, method: MethodDescriptor) -> grpc.RpcMethodHandler[Any, Any]:
    path, behaviour = f"/{_SERVICE.full_name}/{method.name}", getattr(service, method.name)
    coding = {
        "request_deserializer": getattr(fleet_pb2, method.input_type.name).FromString,
        "response_serializer": getattr(fleet_pb2, method.output_type.name).SerializeToString,
    }

    async def answer(requests: Requests, context: Context) -> Any:
        async with gate.call(path, context) as call:
            return await behaviour(await one(requests), call)

    async def answers(requests: Requests, context: Context) -> AsyncIterator[Any]:
        async with gate.call(path, context) as call:
            asked = read(requests) if method.client_streaming else await one(requests)
            async with aclosing(behaviour(asked, call)) as replies:
                async for reply in replies:
                    yield reply

    make: Callable[..., grpc.RpcMethodHandler[Any, Any]]
    if method.server_streaming:
        make = grpc.stream_stream_rpc_method_handler
        return make(answers, **coding)
    make = grpc.stream_unary_rpc_method_handler
    return make(answer, **coding)


async def read(requests: Requests) -> Requests:
    """The messages of a stream; InvalidRequestError for bytes that are none."""
    iterator = aiter(requests)
    while True:
        try:
            request = await anext(iterator, None)
        except DecodeError as error:  # gRPC would log each with its traceback: anybody could fill the log
            raise InvalidRequestError("the bytes are no message of this method") from error
        if request is None:
            return
        yield request


async def one(requests: Requests) -> Any:
    """The one message of a call, within a body's time."""
    try:
        async with asyncio.timeout(LIMITS.body_s):
            async for request in read(requests):
                return request
    except TimeoutError:
        raise RequestTimeoutError("the message did not come in time") from None
    raise InvalidRequestError("the call has no message")
