"""The services of the programs' port: a call is authorized by its metadata before a byte of its message is read.

gRPC would take in the whole message first, from anybody. So every method is served as one that reads a stream, which
looks the same on the wire, and who is refused has sent no more than fits into HTTP/2's first window.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import aclosing
from typing import Any

import grpc
from google.protobuf.descriptor import MethodDescriptor, ServiceDescriptor
from google.protobuf.message import DecodeError
from google.protobuf.message_factory import GetMessageClass
from grpc_health.v1 import health_pb2
from grpc_reflection.v1alpha import reflection_pb2

from gateway.api.grpc.alerts import AlertService
from gateway.api.grpc.authenticate import CallAuthorizer, Context
from gateway.api.grpc.errors import StalledError
from gateway.api.grpc.events import EventService
from gateway.api.grpc.fleet import FleetService
from gateway.api.grpc.health import HealthService
from gateway.api.grpc.reflection import ReflectionService
from gateway.api.grpc.telemetry import TelemetryService
from gateway.errors import InvalidRequestError, RequestTimeoutError
from metaros._proto import alerts_pb2, events_pb2, fleet_pb2, telemetry_pb2
from metaros.limits import LIMITS

__all__ = ["add_programs", "served"]

log = logging.getLogger(__name__)

Requests = AsyncIterator[Any]
REFLECTION_V1 = "grpc.reflection.v1.ServerReflection"


def served() -> dict[str, tuple[ServiceDescriptor, object]]:
    """Every service of the port by its full name: what describes it, and who answers."""
    own: dict[ServiceDescriptor, object] = {
        fleet_pb2.DESCRIPTOR.services_by_name["FleetService"]: FleetService(),
        telemetry_pb2.DESCRIPTOR.services_by_name["TelemetryService"]: TelemetryService(),
        events_pb2.DESCRIPTOR.services_by_name["EventService"]: EventService(),
        alerts_pb2.DESCRIPTOR.services_by_name["AlertService"]: AlertService(),
    }
    health = health_pb2.DESCRIPTOR.services_by_name["Health"]
    reflection = reflection_pb2.DESCRIPTOR.services_by_name["ServerReflection"]
    names = [service.full_name for service in own]
    own[health] = HealthService(names)
    own[reflection] = ReflectionService([*names, health.full_name, reflection.full_name])
    every = {service.full_name: (service, answers) for service, answers in own.items()}
    return {**every, REFLECTION_V1: every[reflection.full_name]}


def add_programs(server: grpc.aio.Server, authorizer: CallAuthorizer) -> None:
    """Serve every method of every description."""
    for name, (service, answers) in served().items():
        handlers = {method.name: _handler(authorizer, name, answers, method) for method in service.methods}
        server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler(name, handlers),))
        server.add_registered_method_handlers(name, handlers)


def _handler(
    authorizer: CallAuthorizer, name: str, service: object, method: MethodDescriptor
) -> grpc.RpcMethodHandler[Any, Any]:
    path, behaviour = f"/{name}/{method.name}", getattr(service, method.name)
    coding: dict[str, Any] = {
        "request_deserializer": GetMessageClass(method.input_type).FromString,
        "response_serializer": serialised,
    }

    async def answer(requests: Requests, context: Context) -> Any:
        async with authorizer.call(path, context) as call:
            return await behaviour(await one(requests), call)

    async def answers(requests: Requests, context: Context) -> None:
        async with authorizer.call(path, context) as call:
            asked = read(requests) if method.client_streaming else await one(requests)
            async with aclosing(behaviour(asked, call)) as replies:
                async for reply in replies:
                    await written(context, reply, within_s=call.services.settings.viewer_stall_s)

    make: Callable[..., grpc.RpcMethodHandler[Any, Any]]
    if method.server_streaming:
        make = grpc.stream_stream_rpc_method_handler
        return make(answers, **coding)
    make = grpc.stream_unary_rpc_method_handler
    return make(answer, **coding)


def serialised(reply: Any) -> bytes:
    """A reply's bytes; what many calls share is made of bytes already."""
    data: bytes = reply if isinstance(reply, bytes) else reply.SerializeToString()
    return data


async def written(context: Context, reply: Any, *, within_s: float) -> None:
    """Write a reply; StalledError when its reader makes no room for it."""
    try:
        async with asyncio.timeout(within_s):
            await context.write(reply)
    except TimeoutError:
        log.info("a stream to %s is ended: nothing of it was read for %g s", context.peer(), within_s)
        raise StalledError(f"nothing of this stream was read for {within_s:g} s") from None


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
