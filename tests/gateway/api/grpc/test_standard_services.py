"""What gRPC's own tools expect of a server: health, reflection under both names, and status details."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import grpc
import pytest
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, RetryInfo
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection_pb2
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase
from grpc_status import rpc_status

from gateway.api.authorization import RPC_PERMISSIONS
from gateway.api.grpc import reflection
from gateway.api.grpc.errors import details
from gateway.api.grpc.serving import served
from gateway.domain.principal import Role
from gateway.errors import LeaseTakenError, RequestTimeoutError, TooManyRequestsError
from metaros._proto import fleet_pb2, fleet_pb2_grpc
from metaros.limits import LIMITS
from tests.gateway.harness import RING, ScriptedAgent, running_gateway
from tests.support.gateways.memory_authenticator import bearer

KEY = RING.add(role=Role.OPERATOR)
METADATA = tuple((name.lower(), value) for name, value in bearer(KEY).items())
ROOT = Path(__file__).resolve().parents[4]
STATUS = health_pb2.HealthCheckResponse.ServingStatus


async def test_health_is_reported_to_anybody(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, anonymous=False) as ready:
        async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.api_grpc_port}") as channel:
            stub = health_pb2_grpc.HealthStub(channel)
            for name in ("", "metaros.v1.FleetService", "metaros.v1.TelemetryService"):
                answer = await stub.Check(health_pb2.HealthCheckRequest(service=name), timeout=60)
                assert answer.status == STATUS.SERVING, name
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await stub.Check(health_pb2.HealthCheckRequest(service="another"), timeout=60)
            assert caught.value.code() is grpc.StatusCode.NOT_FOUND
            watching = stub.Watch(health_pb2.HealthCheckRequest(service="another"), timeout=60)
            assert (await watching.read()).status == STATUS.SERVICE_UNKNOWN
            watching.cancel()


def ask_by_reflection(target: str) -> tuple[set[str], list[str]]:
    """A client that has no generated code: the services' names, and the robots that ListRobots answers with."""
    with grpc.insecure_channel(target) as channel:
        database = ProtoReflectionDescriptorDatabase(channel)
        pool = DescriptorPool(database)
        service = pool.FindServiceByName("metaros.v1.FleetService")
        method = service.FindMethodByName("ListRobots")
        request, answer = GetMessageClass(method.input_type), GetMessageClass(method.output_type)
        call = channel.unary_unary(f"/{service.full_name}/ListRobots", request.SerializeToString, answer.FromString)
        robots = call(request(), metadata=METADATA, timeout=60).robots
        return set(database.get_services()), [robot.robot for robot in robots]


async def test_a_client_that_knows_nothing_learns_all_by_reflection(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, anonymous=False) as ready, ScriptedAgent(ready):
        target = f"127.0.0.1:{ready.api_grpc_port}"
        services, robots = await asyncio.to_thread(ask_by_reflection, target)
        assert services | {"grpc.reflection.v1.ServerReflection"} == set(served())
        assert robots == ["sim_1"]
        async with grpc.aio.insecure_channel(target) as channel:
            call = channel.stream_stream(
                "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
                reflection_pb2.ServerReflectionRequest.SerializeToString,
                reflection_pb2.ServerReflectionResponse.FromString,
            )
            asked = iter([reflection_pb2.ServerReflectionRequest(list_services="")])
            answers = [answer async for answer in call(asked, timeout=60)]
            assert {item.name for item in answers[0].list_services_response.service} == services


async def test_who_asks_reflection_nothing_is_sent_away(monkeypatch: pytest.MonkeyPatch) -> None:
    async def silent() -> AsyncIterator[Any]:
        await asyncio.Event().wait()
        yield

    monkeypatch.setattr(reflection, "LIMITS", replace(LIMITS, body_s=0.0))
    call: Any = None  # who asks does not matter
    with pytest.raises(RequestTimeoutError, match="nothing was asked for so long"):
        await anext(reflection.ReflectionService(["a.B"]).ServerReflectionInfo(silent(), call))


async def test_a_refusal_has_its_code_and_its_field_in_the_details(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready):
        async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.api_grpc_port}") as channel:
            stub = fleet_pb2_grpc.FleetServiceStub(channel)
            request = fleet_pb2.SendCommandRequest(robot="sim_1", kind="set_uplink", request_json="[1]")
            with pytest.raises(grpc.aio.AioRpcError) as caught:
                await stub.SendCommand(request, metadata=METADATA, timeout=60)
    status = await rpc_status.aio.from_call(Ended(caught.value))
    assert status is not None
    assert status.code == grpc.StatusCode.INVALID_ARGUMENT.value[0]
    info, fault = ErrorInfo(), BadRequest()
    assert status.details[0].Unpack(info)
    assert (info.reason, info.domain) == ("invalid_request", "metaros")
    assert status.details[1].Unpack(fault)
    assert fault.field_violations[0].field == "request_json"


class Ended:
    """A refused call as grpc_status asks for it."""

    def __init__(self, error: grpc.aio.AioRpcError) -> None:
        self._error = error

    async def trailing_metadata(self) -> object:
        """As it came."""
        return self._error.trailing_metadata()

    async def code(self) -> grpc.StatusCode:
        """Of the status line."""
        return self._error.code()

    async def details(self) -> str | None:
        """Of the status line."""
        return self._error.details()


def test_when_to_come_back_and_who_holds_the_lease() -> None:
    info, retry = details(TooManyRequestsError("wait", retry_after_s=1.5))
    assert isinstance(info, ErrorInfo)
    assert info.reason == "too_many_requests"
    assert isinstance(retry, RetryInfo)
    assert retry.retry_delay.ToMilliseconds() == 1500
    (taken,) = details(LeaseTakenError("taken", holder="Ann"))
    assert isinstance(taken, ErrorInfo)
    assert dict(taken.metadata) == {"holder": "Ann"}


def test_every_method_is_in_the_reference() -> None:
    page = (ROOT / "docs/reference/grpc.md").read_text()
    for path in RPC_PERMISSIONS:
        if not path.startswith("/metaros.v1.Link/"):
            service, _, method = path[1:].partition("/")
            assert f"`{method}`" in page, path
            assert service.removesuffix("v1alpha.ServerReflection") in page, path
