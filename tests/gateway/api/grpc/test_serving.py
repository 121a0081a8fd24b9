"""The API over gRPC on its own port: its TLS, who is let in before a message is read, and what is made of odd calls."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import grpc
import pytest

from gateway.api.grpc.authenticate import CallAuthorizer
from gateway.domain.principal import Role
from gateway.errors import StoreError
from gateway.main import Ready
from gateway.server.announce import ready_line, write_status
from gateway.settings import Settings
from metaros._proto import fleet_pb2, fleet_pb2_grpc
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.gateway.harness import RING, ScriptedAgent, client, running_gateway
from tests.support.gateways.memory_authenticator import bearer
from tests.support.servers.certificates import make_certificate

VIEWER = RING.add(role=Role.VIEWER)
LIST = "/metaros.v1.FleetService/ListRobots"
WATCH = "/metaros.v1.FleetService/WatchCommand"
Metadata = tuple[tuple[str, str], ...]


def known_by(key: str) -> Metadata:
    """Metadata with a key; "": none."""
    return tuple((name.lower(), value) for name, value in bearer(key).items())


@asynccontextmanager
async def fleet(ready: Ready, roots_pem: str = "", *, options: Any = ()) -> AsyncIterator[grpc.aio.Channel]:
    """A channel to the programs' port; over TLS with roots."""
    target = f"127.0.0.1:{ready.api_grpc_port}"
    if roots_pem:
        opened = grpc.aio.secure_channel(target, grpc.ssl_channel_credentials(roots_pem.encode()), options)
    else:
        opened = grpc.aio.insecure_channel(target)
    async with opened as channel:
        yield channel


async def refusal(channel: grpc.aio.Channel, method: str, body: bytes, key: str) -> tuple[grpc.StatusCode, str]:
    """How a call with these bytes ends that is not to succeed: status, and our code."""
    call = channel.unary_unary(method)(body, metadata=known_by(key), timeout=60)
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await call
    return caught.value.code(), str(dict(caught.value.trailing_metadata() or ()).get("metaros-code", ""))


async def robots(channel: grpc.aio.Channel, key: str) -> list[str]:
    """What ListRobots says."""
    stub = fleet_pb2_grpc.FleetServiceStub(channel)
    answer = await stub.ListRobots(fleet_pb2.ListRobotsRequest(), metadata=known_by(key), timeout=60)
    return [item.robot for item in answer.robots]


async def test_over_tls_a_key_is_enough_and_a_certificate_is_not_asked_for(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, tls="on", anonymous=False) as ready:
        async with fleet(ready, ready.roots_pem) as channel:
            assert await robots(channel, VIEWER) == []
            assert await refusal(channel, LIST, b"", "") == (grpc.StatusCode.UNAUTHENTICATED, "sign_in")
        async with fleet(ready) as channel:
            assert (await refusal(channel, LIST, b"", VIEWER))[0] is grpc.StatusCode.UNAVAILABLE, "nothing goes plain"


async def test_a_certificate_made_remote_is_shown_where_it_holds_the_name(tmp_path: Path) -> None:
    cert = make_certificate(tmp_path)  # for localhost
    names = {"tls_cert": cert, "tls_key": cert.with_suffix(".key"), "allow_hosts": ("fleet.example",)}
    async with running_gateway(tmp_path, **names) as ready:
        for roots_pem, name in ((cert.read_text(), "localhost"), (ready.roots_pem, "fleet.example")):
            options = [("grpc.ssl_target_name_override", name)]
            async with fleet(ready, roots_pem, options=options) as channel:
                assert await robots(channel, VIEWER) == [], f"{name} has a certificate under that root"


async def test_robots_port_knows_no_fleet_and_the_programs_port_no_links(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        async with fleet(ready) as channel:
            assert (await refusal(channel, "/metaros.v1.Link/Connect", b"", ""))[0] is grpc.StatusCode.UNIMPLEMENTED
        async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.grpc_port}") as channel:
            assert (await refusal(channel, LIST, b"", VIEWER))[0] is grpc.StatusCode.UNIMPLEMENTED


async def test_who_is_refused_is_refused_before_the_message_is_looked_at(tmp_path: Path) -> None:
    """A message over the limit and one that is none: a stranger hears nothing of either, as nobody read them."""
    too_long, no_message = bytes(LIMITS.frame_bytes + 1), b"\xff" * 32
    wrong = "mrk_" + "0" * 16 + "_" + "0" * 64
    async with running_gateway(tmp_path, anonymous=False) as ready, fleet(ready) as channel:
        for method in (LIST, WATCH):
            for body in (too_long, no_message):
                assert (await refusal(channel, method, body, ""))[1] == "sign_in"
                assert (await refusal(channel, method, body, wrong))[1] == "bad_credentials"
            assert (await refusal(channel, method, too_long, VIEWER))[0] is grpc.StatusCode.RESOURCE_EXHAUSTED
            assert (await refusal(channel, method, no_message, VIEWER))[1] == "invalid_request"


async def test_a_call_without_a_message_and_one_with_two(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready), fleet(ready) as channel:

        async def of(count: int) -> AsyncIterator[bytes]:
            for _ in range(count):
                yield b""

        call = channel.stream_unary(LIST)
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await call(of(0), metadata=known_by(VIEWER), timeout=60)
        assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
        assert b"sim_1" in await call(of(2), metadata=known_by(VIEWER), timeout=60), "the first counts"


async def test_the_ready_line_and_the_status_name_the_port(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        line = ready_line(Settings(data_dir=tmp_path / "data"), ready)
        assert f"programs 127.0.0.1:{ready.api_grpc_port}" in line
        write_status(tmp_path / "status.json", ready)
        assert f'"api_grpc_port": {ready.api_grpc_port}' in (tmp_path / "status.json").read_text()


@asynccontextmanager
async def driven(ready: Ready, channel: grpc.aio.Channel, agent: ScriptedAgent, key: str) -> AsyncIterator[Any]:
    """A Drive stream whose robot granted the lease and heard the first speed."""
    call = fleet_pb2_grpc.FleetServiceStub(channel).Drive(metadata=known_by(key))
    await call.write(fleet_pb2.DriveRequest(robot="sim_1", holder="me", linear=0.5))
    grant = (await agent.next("command")).command
    assert grant.WhichOneof("action") == "grant_lease"
    await agent.answer(grant)
    assert (await call.read()).lease_id == grant.grant_lease.lease_id
    yield call


async def stopped(agent: ScriptedAgent) -> None:
    """The robot is told to stand, and has its lease back."""
    release = (await agent.next("command")).command
    assert release.WhichOneof("action") == "release_lease"
    await agent.answer(release)


async def test_a_robot_that_is_driven_stops_with_the_stream(tmp_path: Path, attentive: None) -> None:
    key = RING.add(role=Role.OPERATOR)
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent, fleet(ready) as channel:
        for how in ("cancelled", "half closed", "key revoked"):
            async with driven(ready, channel, agent, key) as call:
                if how == "cancelled":
                    call.cancel()
                elif how == "half closed":
                    await call.done_writing()
                else:
                    RING.revoke(key)
                await stopped(agent)
                if how == "key revoked":
                    with pytest.raises(grpc.aio.AioRpcError) as caught:
                        await call.read()
                    assert dict(caught.value.trailing_metadata() or ())["metaros-code"] == "bad_credentials"
            async with client(ready) as http:
                assert (await http.get("/api/v1/robots/sim_1")).json()["lease"] is None, how


async def test_what_is_done_is_answered_though_the_audit_log_cannot_take_it(caplog: pytest.LogCaptureFixture) -> None:
    reported: list[tuple[str, int]] = []
    method = "/metaros.v1.FleetService/SendCommand"
    key = RING.add(role=Role.OPERATOR)

    async def record(**_facts: Any) -> None:
        raise StoreError("it is away")

    services: Any = SimpleNamespace(
        clock=ManualClock(),
        authenticator=RING,
        audit=SimpleNamespace(check_room=lambda: None, record=record),
        rates=SimpleNamespace(check=lambda *_: None, take=lambda *_: None),
        meters=SimpleNamespace(rpc=lambda name, status, seconds: reported.append((name, status))),
    )
    context: Any = SimpleNamespace(peer=lambda: "ipv4:127.0.0.1:5", invocation_metadata=lambda: known_by(key))
    async with CallAuthorizer(lambda: services).call(method, context) as call:
        call.require("r1")
    assert reported == [(method, 200)]
    assert [(one.levelname, one.getMessage()) for one in caplog.records] == [
        ("WARNING", f"the audit log has no row of {method}: it is away")
    ]
