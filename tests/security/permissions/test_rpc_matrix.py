"""Every RPC, asked by everybody: what is registered declares a permission, and answers exactly as the table says.

Link is robots', on a port of its own: a key counts as nothing there, and over TLS nobody is heard at all without a
certificate of the fleet. The other services are people's, on theirs: only a key counts, and a robot's certificate is
nothing. Health and reflection are anybody's there.
"""

from __future__ import annotations

import asyncio
import functools
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, cast

import grpc
import pytest
from google.protobuf.message_factory import GetMessageClass

from gateway.api.authorization import RPC_PERMISSIONS
from gateway.api.grpc.authenticate import CallAuthorizer
from gateway.api.grpc.errors import CODE_KEY
from gateway.api.grpc.serving import add_programs
from gateway.domain.principal import Principal, Role
from gateway.identity.certificates.ca import key_pem
from gateway.identity.permissions import permission
from gateway.ingest.link_service import LinkService
from gateway.main import Ready
from metaros._proto import alerts_pb2, events_pb2, fleet_pb2, fleet_pb2_grpc, link_pb2, link_pb2_grpc, telemetry_pb2
from tests.gateway.harness import ScriptedAgent, client, running_gateway
from tests.gateway.identity.identity_rig import Held
from tests.gateway.test_robot_links import (
    ADMIN,
    RING,
    GrpcLane,
    bare,
    enrolled,
    greet,
    refused,
    revoke,
    tls_gateway,
    tls_lane,
)
from tests.support.gateways.memory_authenticator import bearer
from tests.support.gateways.plain_http import FREE

KEYS = {
    "anonymous": "",
    "viewer": RING.add(role=Role.VIEWER),
    "operator": RING.add(role=Role.OPERATOR),
    "admin": ADMIN,
    "other scope": RING.add(role=Role.ADMIN, robots=("other_*",)),
    "unknown": "mrk_" + "0" * 16 + "_" + "0" * 64,
}


PROTOS = (fleet_pb2.DESCRIPTOR, telemetry_pb2.DESCRIPTOR, events_pb2.DESCRIPTOR, alerts_pb2.DESCRIPTOR)
PROGRAMS = tuple(service.full_name for file in PROTOS for service in file.services_by_name.values())
LISTS = ("ListRobots", "ListEvents", "WatchEvents", "Subscribe", "ListAlerts", "CountAlerts", "WatchAlerts")
FLEET_WIDE = (*LISTS, "ListSilences", "ListChecks", "ListRoutes")  # who is to see nothing gets nothing
WHOLE_FLEET = ("AddSilence", "SetCheck", "ResetCheck", "TestRoute")  # as they are asked here: for every robot
LEAST = {"viewer": Role.VIEWER, "operator": Role.OPERATOR, "admin": Role.ADMIN, "other scope": Role.ADMIN}
UNSEEN = ("unknown_robot", "unknown_command", "unknown_alert", "unknown_silence")
FLEET_SERVICE = "/metaros.v1.FleetService/"


class Registered:
    """Takes the handlers that a server is given."""

    def __init__(self) -> None:
        self.methods: set[str] = set()

    def add_generic_rpc_handlers(self, handlers: Any) -> None:
        """Each can be asked for a method only by name; the names come by the other endpoint."""

    def add_registered_method_handlers(self, service: str, handlers: dict[str, Any]) -> None:
        """By name."""
        self.methods |= {f"/{service}/{name}" for name in handlers}


def undeclared(methods: set[str]) -> set[str]:
    """RPCs without a row of the table."""
    return {method for method in methods if method not in RPC_PERMISSIONS}


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> Registered:
    """What every gRPC server of this test is given, as well as the server itself."""
    seen, make = Registered(), grpc.aio.server

    def server(*args: Any, **options: Any) -> Any:
        made = make(*args, **options)
        add = made.add_registered_method_handlers

        def both(service: str, handlers: dict[str, Any]) -> None:
            seen.add_registered_method_handlers(service, handlers)
            add(service, handlers)

        made.add_registered_method_handlers = both
        return made

    monkeypatch.setattr(grpc.aio, "server", server)
    return seen


async def test_every_registered_rpc_declares_a_permission(tmp_path: Path, registered: Registered) -> None:
    async with running_gateway(tmp_path):
        assert registered.methods, "the gateway has a server, and it has methods"
    assert undeclared(registered.methods) == set()
    assert registered.methods == set(RPC_PERMISSIONS), "and the table names none that is not there"
    assert {permission(name).who for path, name in RPC_PERMISSIONS.items() if "Link" in path} == {"robots"}
    assert {permission(name).who for path, name in RPC_PERMISSIONS.items() if path[1:].startswith(PROGRAMS)} == {
        "people"
    }
    assert {permission(name).who for path, name in RPC_PERMISSIONS.items() if "/grpc." in path} == {"anyone"}
    handlers = {"Shutdown": grpc.unary_unary_rpc_method_handler(lambda request, context: request)}
    registered.add_registered_method_handlers("metaros.v1.Link", handlers)
    assert undeclared(registered.methods) == {"/metaros.v1.Link/Shutdown"}, "one without a row is seen"


def test_the_handlers_are_those_of_the_description() -> None:
    seen = Registered()
    link_pb2_grpc.add_LinkServicer_to_server(LinkService.__new__(LinkService), seen)
    add_programs(cast(Any, seen), CallAuthorizer.__new__(CallAuthorizer))
    files = (link_pb2.DESCRIPTOR, *PROTOS)
    services = [service for file in files for service in file.services_by_name.values()]
    described = {f"/{one.full_name}/{method.name}" for one in services for method in one.methods}
    assert {method for method in seen.methods if method.startswith("/metaros.")} == described


async def plain(ready: Ready, hello: link_pb2.Hello, held: Held | None = None, *, key: str = "") -> str:
    """What a lane on the plain port hears, with a key in its metadata."""
    metadata = tuple((name.lower(), value) for name, value in bearer(key).items())
    async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.grpc_port}") as channel:
        return await greet(GrpcLane(link_pb2_grpc.LinkStub(channel).Connect(metadata=metadata)), hello, held)


async def test_everybody_on_the_plain_port_of_this_machine(tmp_path: Path) -> None:
    async with running_gateway(tmp_path / "a", authenticator=RING) as ready:
        held, _ = await enrolled(ready)
        gone, _ = await enrolled(ready, "gone")
        await revoke(ready, "gone")
        for who, key in KEYS.items():
            assert await plain(ready, bare("arm"), key=key) == "not_enrolled", f"{who} is not the robot"
            assert await plain(ready, gone.hello(), gone, key=key) == "certificate_revoked", who
        assert await plain(ready, held.hello(), held) == "welcome"
    async with running_gateway(tmp_path / "b", authenticator=RING, require_enrolment=True) as ready:
        for who, key in KEYS.items():
            assert await plain(ready, bare("sim_1"), key=key) == "not_enrolled", who


FLEET = sorted(path for path in RPC_PERMISSIONS if path[1:].startswith(PROGRAMS))
GATE = {"sign_in", "bad_credentials", "forbidden", "unknown_robot", "unknown_command", "too_many_requests"}


@asynccontextmanager
async def programs(ready: Ready, chain_pem: str | None = None, key: Any = None) -> AsyncIterator[grpc.aio.Channel]:
    """A channel to the programs' port, as the gateway speaks there; with a robot's certificate where one is given."""
    where = f"127.0.0.1:{ready.api_grpc_port}"
    held = (key_pem(key), chain_pem.encode()) if key is not None and chain_pem is not None else (None, None)
    credentials = grpc.ssl_channel_credentials(ready.roots_pem.encode(), *held)
    opened = grpc.aio.secure_channel(where, credentials) if ready.tls else grpc.aio.insecure_channel(where)
    async with opened as channel:
        yield channel


@functools.cache
def harmless(path: str) -> tuple[Any, bool, bool]:
    """A request that could do nothing if let in: its robot is another one, or offline; and which ends stream."""
    service, _, method = path[1:].partition("/")
    descriptions = {one.full_name: one for file in PROTOS for one in file.services_by_name.values()}
    description = descriptions[service].methods_by_name[method]
    request = GetMessageClass(description.input_type)()
    fields = {field.name: field for field in description.input_type.fields}
    for name, value in (("robot", "sim_1"), ("kind", "set_uplink"), ("topic", "x"), ("holder", "h"), ("text", "x")):
        if name in fields and not fields[name].is_repeated:
            setattr(request, name, value)
    return request, description.client_streaming, description.server_streaming


# What grpc.aio says of a call that was answered before its request was sent: the answer is lost in the client.
UNSENT = "Internal error from Core"


async def attempt(channel: grpc.aio.Channel, path: str, key: str) -> tuple[grpc.StatusCode, str]:
    """The status and code of such a call."""
    request, *streams = harmless(path)
    metadata = tuple((name.lower(), value) for name, value in bearer(key).items())
    make: Any = {(False, False): channel.unary_unary, (False, True): channel.unary_stream}.get(
        (streams[0], streams[1]), channel.stream_stream
    )
    asked = iter([request]) if streams[0] else request
    call = make(path, type(request).SerializeToString)(asked, metadata=metadata, timeout=60)
    try:
        if not streams[1]:
            await call
            return grpc.StatusCode.OK, ""
        async for _ in call:
            break
        call.cancel()
    except grpc.aio.AioRpcError as error:
        if streams[0] and error.details() == UNSENT:
            return await attempt(channel, path, key)
        return error.code(), str(dict(error.trailing_metadata() or ()).get(CODE_KEY, "?"))
    return grpc.StatusCode.OK, ""


def as_it_should(path: str, who: str, status: grpc.StatusCode, code: str, *, anonymous: bool) -> bool:
    """Whether that is what the table says; `anonymous`: whether who shows nothing is a viewer."""
    row, method = permission(RPC_PERMISSIONS[path]), path.rpartition("/")[2]
    if who == "unknown":
        return code == "bad_credentials" and status is grpc.StatusCode.UNAUTHENTICATED
    if who == "anonymous" and (row.mutates or not anonymous):
        return code == "sign_in" and status is grpc.StatusCode.UNAUTHENTICATED
    if row.least > LEAST.get(who, Role.VIEWER) or (method in WHOLE_FLEET and who != "admin"):
        return code == "forbidden" and status is grpc.StatusCode.PERMISSION_DENIED
    if who == "other scope" and method not in FLEET_WIDE:
        return code in UNSEEN
    if method in ("GetCommand", "WatchCommand"):
        return code == "unknown_command"
    return code not in GATE and code != "?"


@pytest.mark.parametrize("tls", ["off", "on"])
@pytest.mark.parametrize("anonymous", [True, False])
async def test_everybody_at_every_method_of_the_fleet(tmp_path: Path, anonymous: bool, tls: str) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready, ScriptedAgent(ready):
        pass  # known, and offline by now
    askers = KEYS if anonymous else {"anonymous": ""}  # to the others it makes no difference
    wrong = []
    settings = {"anonymous": anonymous, "tls": tls, **FREE}
    async with running_gateway(tmp_path, authenticator=RING, **settings) as ready, programs(ready) as channel:
        for path in FLEET:
            answers = await asyncio.gather(*(attempt(channel, path, key) for key in askers.values()))
            for who, (status, code) in zip(askers, answers, strict=True):
                if not as_it_should(path, who, status, code, anonymous=anonymous):
                    wrong.append((who, path, status, code))
    assert wrong == []


async def test_a_key_s_robots_and_what_people_did_are_as_in_rest(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        async with ScriptedAgent(ready), programs(ready) as channel:
            stub = fleet_pb2_grpc.FleetServiceStub(channel)

            async def robots(key: str) -> list[str]:
                metadata = tuple((name.lower(), value) for name, value in bearer(key).items())
                answer = await stub.ListRobots(fleet_pb2.ListRobotsRequest(), metadata=metadata)
                return [robot.robot for robot in answer.robots]

            assert await robots(KEYS["viewer"]) == ["sim_1"]
            assert await robots(KEYS["other scope"]) == []
            assert (await attempt(channel, f"{FLEET_SERVICE}RenewLease", KEYS["operator"]))[1] == "lease_required"
            async with client(ready, key=ADMIN) as http:
                rows = (await http.get("/api/v1/audit")).json()["rows"]
            reported = [(row["method"], row["action"], row["code"]) for row in rows if row["method"] == "GRPC"]
            assert reported[0] == ("GRPC", "robots.drive", "lease_required")


async def test_everybody_over_tls(tmp_path: Path) -> None:
    async with tls_gateway(tmp_path) as ready:
        held, given = await enrolled(ready)
        other, theirs = await enrolled(ready, "leg")
        roots, chain = given["roots"], given["certificate"] + given["chain"]
        assert await refused(ready, roots), "without a certificate nobody is heard, whatever key they hold"
        async with tls_lane(ready, roots, chain, held.key) as opened:
            assert await greet(opened, bare("arm")) == "welcome"
        async with tls_lane(ready, roots, theirs["certificate"] + theirs["chain"], other.key) as opened:
            assert await greet(opened, bare("arm", number=2)) == "certificate_foreign"
        await revoke(ready, "arm")
        async with tls_lane(ready, roots, chain, held.key) as opened:
            assert await greet(opened, bare("arm", number=3)) == "certificate_revoked"


async def test_a_robot_s_certificate_is_nobody_at_the_fleet(tmp_path: Path) -> None:
    async with tls_gateway(tmp_path) as ready:
        held, given = await enrolled(ready)
        async with programs(ready, given["certificate"] + given["chain"], held.key) as channel:
            for path in FLEET:
                mutates = permission(RPC_PERMISSIONS[path]).mutates
                assert ((await attempt(channel, path, ""))[1] == "sign_in") is mutates, path
            assert (await attempt(channel, f"{FLEET_SERVICE}ListRobots", KEYS["unknown"]))[1] == "bad_credentials"


async def test_no_other_method_answers(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        for port in (ready.grpc_port, ready.api_grpc_port):
            for path in ("/metaros.v1.Link/Shutdown", "/grpc.channelz.v1.Channelz/GetServers"):
                async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
                    with pytest.raises(grpc.aio.AioRpcError) as caught:
                        await channel.unary_unary(path)(b"", timeout=60)
                assert caught.value.code() == grpc.StatusCode.UNIMPLEMENTED


async def test_a_robot_s_identity_is_nobody_in_the_api(tmp_path: Path) -> None:
    """The other way round: what a robot holds opens nothing of people's."""
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        held, _ = await enrolled(ready)
        for text in (held.certificate.replace("\n", ""), "arm", held.certificate[30:90]):
            async with client(ready, key="") as http:
                answer = await http.get("/api/v1/robots", headers={"Authorization": f"Bearer {text}"})
                assert (answer.status_code, answer.json()["code"]) == (401, "bad_credentials")
        robot = Principal(kind="robot", id="arm", robots=("arm",), role=Role.ADMIN)
        rows = [row for row in map(permission, ("robots.read", "users.manage", "agent.link")) if row.granted(robot)]
        assert [row.name for row in rows] == ["agent.link"]
