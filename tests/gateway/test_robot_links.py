"""Links of enrolled robots on real transports: challenges over gRPC and WebSocket, certificates over TLS, the cut."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import grpc
import httpx
import pytest
import pytest_asyncio
from websockets.asyncio.client import connect

from gateway.domain.principal import Role
from gateway.identity.certificates.ca import issue_robot, key_pem, make_intermediate, make_root, pem
from gateway.main import Ready
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.clock import SystemClock
from tests.gateway.harness import CONTROL, client, running_gateway
from tests.gateway.identity.identity_rig import Held
from tests.gateway.identity.robot_keys import ask, new_key
from tests.support.gateways.memory_authenticator import KeyRing
from tests.support.servers.postgres import PostgresServer

shared = pytest.mark.asyncio(loop_scope="module")
FAR = {"X-Forwarded-For": "10.0.0.7"}
RING = KeyRing()
ADMIN = RING.add(role=Role.ADMIN, name="ada")


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def ready(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Ready]:
    """A gateway that the tests of this file share; its robots are their own."""
    async with running_gateway(tmp_path_factory.mktemp("gateway"), authenticator=RING) as ready:
        yield ready


async def enrolled(ready: Ready, robot: str = "arm", *, bound: bool = False) -> tuple[Held, dict[str, Any]]:
    """A robot with a certificate, and the gateway's answer."""
    async with client(ready, key=ADMIN) as http:
        order = {"robot": robot} if bound else {}
        token = (await http.post("/api/v1/enrolment-tokens", json=order)).json()["token"]
        key = new_key()
        answer = await http.post("/api/v1/enrol", json={"token": token, "robot": robot, "csr": ask(key)})
        assert answer.status_code == 201, answer.text
    return Held(robot, key, answer.json()["certificate"]), answer.json()


async def revoke(ready: Ready, robot: str) -> None:
    """What an administrator does."""
    async with client(ready, key=ADMIN) as http:
        answer = await http.post(f"/api/v1/robots/{robot}/revoke", json={"reason": "stolen"})
        assert answer.status_code == 200, answer.text


class GrpcLane:
    """A lane over gRPC."""

    def __init__(self, call: Any) -> None:
        self._call = call

    async def send(self, **frame: Any) -> None:
        """Write one frame."""
        await self._call.write(link_pb2.AgentFrame(**frame))

    async def next(self) -> link_pb2.GatewayFrame:
        """The next frame."""
        frame = await self._call.read()
        assert frame is not grpc.aio.EOF
        return link_pb2.GatewayFrame.FromString(frame.SerializeToString())


class SocketLane:
    """A lane over a WebSocket."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket

    async def send(self, **frame: Any) -> None:
        """Write one frame."""
        await self._socket.send(link_pb2.AgentFrame(**frame).SerializeToString())

    async def next(self) -> link_pb2.GatewayFrame:
        """The next frame."""
        return link_pb2.GatewayFrame.FromString(await self._socket.recv())


Lane = GrpcLane | SocketLane


@asynccontextmanager
async def lane(ready: Ready, kind: str, **headers: str) -> AsyncIterator[Lane]:
    """An open connection that has said nothing yet."""
    if kind == "grpc":
        async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.grpc_port}") as channel:
            yield GrpcLane(link_pb2_grpc.LinkStub(channel).Connect())
        return
    url = ready.url.replace("http", "ws", 1) + "/api/v1/link"
    options: dict[str, Any] = {"subprotocols": ["metaros.link.v1"], "proxy": None, "additional_headers": headers}
    async with connect(url, **options) as socket:
        yield SocketLane(socket)


async def greet(open_lane: Lane, hello: link_pb2.Hello, held: Held | None = None, *, key: Any = None) -> str:
    """Say Hello, answer the challenge if there is one; "welcome", or the code of the Goodbye."""
    await open_lane.send(hello=hello)
    frame = await asyncio.wait_for(open_lane.next(), 60)
    if frame.WhichOneof("frame") == "challenge":
        assert held is not None
        await open_lane.send(proof=link_pb2.Proof(signature=held.prove(hello, frame.challenge, key=key)))
        frame = await asyncio.wait_for(open_lane.next(), 60)
    return frame.goodbye.code if frame.WhichOneof("frame") == "goodbye" else str(frame.WhichOneof("frame"))


async def said(open_lane: Lane) -> link_pb2.Goodbye:
    """The Goodbye that ends the lane."""
    async with asyncio.timeout(60):
        while True:
            frame = await open_lane.next()
            if frame.WhichOneof("frame") == "goodbye":
                return frame.goodbye


def bare(robot: str, *, number: int = 1) -> link_pb2.Hello:
    """The Hello of a robot without identity."""
    return link_pb2.Hello(
        protocol=1,
        robot_id=robot,
        session_id=b"b" * 16,
        session_number=number,
        lane=CONTROL,
        namespace=f"/{robot}",
    )


@shared
async def test_an_enrolled_robot_proves_itself_on_a_plain_connection(ready: Ready) -> None:
    held, _ = await enrolled(ready)
    other, _ = await enrolled(ready, "leg")
    for kind in ("grpc", "websocket"):
        for hello, key, said in (
            (held.hello(), None, "welcome"),
            (held.hello(), new_key(), "proof_refused"),
            (held.hello(), other.key, "proof_refused"),
            (held.hello(robot="leg"), None, "certificate_foreign"),
            (bare("arm"), None, "not_enrolled"),
            (bare(f"bare_{kind}"), None, "welcome"),
        ):
            async with lane(ready, kind) as opened:
                assert await greet(opened, hello, held, key=key) == said, kind
        async with lane(ready, kind) as opened:
            await opened.send(hello=held.hello())
            assert (await opened.next()).WhichOneof("frame") == "challenge"
            await opened.send(heartbeat=link_pb2.Heartbeat())
            assert (await opened.next()).goodbye.code == "protocol", kind


@shared
async def test_a_live_link_is_cut_when_its_robot_is_revoked(ready: Ready) -> None:
    held, _ = await enrolled(ready, "thief")
    async with lane(ready, "grpc") as opened:
        assert await greet(opened, held.hello(), held) == "welcome"
        await revoke(ready, "thief")
        assert (await said(opened)).code == "certificate_revoked"
    async with lane(ready, "grpc") as opened:
        assert await greet(opened, held.hello(), held) == "certificate_revoked"
    again, _ = await enrolled(ready, "thief", bound=True)
    async with lane(ready, "websocket") as opened:
        assert await greet(opened, again.hello(), again) == "welcome"


async def test_a_link_is_cut_that_was_revoked_at_another_gateway(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    async with (
        running_gateway(tmp_path / "a", authenticator=RING, store_url=url) as one,
        running_gateway(tmp_path / "b", authenticator=RING, store_url=url) as two,
    ):
        held, _ = await enrolled(one)
        async with lane(two, "grpc") as opened:
            assert await greet(opened, held.hello(), held) == "welcome"
            await revoke(one, "arm")
            assert (await said(opened)).code == "certificate_revoked"


@shared
async def test_a_nameless_link_ends_when_its_name_gets_an_identity(ready: Ready) -> None:
    async with lane(ready, "grpc") as opened:
        assert await greet(opened, bare("nameless")) == "welcome"
        await enrolled(ready, "nameless")
        assert (await said(opened)).code == "not_enrolled"


async def test_who_must_be_enrolled(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING, require_enrolment=True) as ready:
        held, _ = await enrolled(ready)
        async with lane(ready, "grpc") as opened:
            assert await greet(opened, bare("sim_1")) == "not_enrolled"
        async with lane(ready, "websocket", **FAR) as opened:
            assert await greet(opened, held.hello(), held) == "welcome"


@shared
async def test_who_comes_from_far_must_be_enrolled(ready: Ready) -> None:
    async with lane(ready, "websocket", **FAR) as opened:
        assert await greet(opened, bare("sim_1")) == "not_enrolled"


@shared
async def test_two_copies_of_a_robot_raise_an_alarm(ready: Ready) -> None:
    held, _ = await enrolled(ready, "twin")
    for number, session in ((1, b"a"), (2, b"b"), (3, b"a")):
        hello = held.hello()
        hello.session_id, hello.session_number = session * 16, number
        async with lane(ready, "grpc") as opened:
            assert await greet(opened, hello, held) == "welcome"
    async with client(ready, key=ADMIN) as http, asyncio.timeout(60):
        while not await alarm(http, "twin"):
            pass


async def alarm(http: httpx.AsyncClient, robot: str) -> str:
    """What the list of identities says of one."""
    found = (await http.get("/api/v1/identities")).json()["identities"]
    return str(next(one["alarm"] for one in found if one["robot"] == robot))


@asynccontextmanager
async def tls_lane(ready: Ready, roots: str, certificate: str = "", key: Any = None) -> AsyncIterator[Lane]:
    """A lane over gRPC with TLS, with a client certificate or without one."""
    credentials = grpc.ssl_channel_credentials(
        roots.encode(), key_pem(key) if key else None, certificate.encode() if key else None
    )
    async with grpc.aio.secure_channel(f"localhost:{ready.grpc_port}", credentials) as channel:
        yield GrpcLane(link_pb2_grpc.LinkStub(channel).Connect())


async def refused(ready: Ready, roots: str, certificate: str = "", key: Any = None) -> bool:
    """Whether TLS itself shows the door."""
    try:
        async with tls_lane(ready, roots, certificate, key) as opened:
            await greet(opened, bare("arm"))
    except (grpc.aio.AioRpcError, AssertionError):
        return True
    return False


async def test_over_tls_the_certificate_says_who_it_is(tmp_path: Path) -> None:
    async with tls_gateway(tmp_path) as ready:
        held, given = await enrolled(ready)
        chain, roots = given["certificate"] + given["chain"], given["roots"]
        async with tls_lane(ready, roots, chain, held.key) as opened:
            assert await greet(opened, bare("arm")) == "welcome"
            await revoke(ready, "arm")
            assert (await said(opened)).code == "certificate_revoked"
        async with tls_lane(ready, roots, chain, held.key) as opened:
            assert await greet(opened, bare("arm", number=2)) == "certificate_revoked"
        other, theirs = await enrolled(ready, "leg")
        async with tls_lane(ready, roots, theirs["certificate"] + theirs["chain"], other.key) as opened:
            assert await greet(opened, bare("arm", number=3)) == "certificate_foreign"
        assert await refused(ready, roots)
        now_ns, key = SystemClock().wall_ns(), new_key()
        stranger = make_intermediate("x", *make_root("x", now_ns=now_ns), now_ns=now_ns)
        forged = issue_robot(stranger, key.public_key(), fleet="x", robot="arm", now_ns=now_ns, life_s=86_400.0)
        assert await refused(ready, roots, pem(forged, stranger.certificate), key)
        assert await refused(ready, pem(stranger.root), chain, held.key)  # and a robot does not believe a stranger


@asynccontextmanager
async def tls_gateway(folder: Path) -> AsyncIterator[Ready]:
    """A gateway whose ports speak TLS."""
    async with running_gateway(folder, authenticator=RING, tls="on") as ready:
        yield ready
