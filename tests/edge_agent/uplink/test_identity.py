"""An enrolled robot's link over real TLS, gRPC and WebSockets: who is let in, who is trusted, what renewal does."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
from dataclasses import replace
from pathlib import Path

import pytest

from edge_agent.errors import LinkError, UnprovenError
from edge_agent.identity.credentials import Credentials
from edge_agent.identity.files import IdentityFiles, RobotIdentity
from edge_agent.identity.key import key_to_pem, new_key
from edge_agent.identity.renewal_task import RenewalTask
from edge_agent.uplink.session import AgentSession
from edge_agent.uplink.uplink import transports_with
from metaros.clock import SystemClock
from tests.support.gateways.mtls_gateway import GuardedGrpc, GuardedSocket, guarded, server_context
from tests.support.robots.uplinks import WHO, Owner, feed, running, wait
from tests.support.servers.certificates import make_certificate
from tests.support.servers.enrol_server import enrol_server
from tests.support.servers.fleet_ca import FleetCa
from tests.support.servers.nginx import Nginx, nginx_program

ROBOT = f"spiffe://testfleet/robot/{WHO.robot_id}"


def identity_of(ca: FleetCa, **changes: object) -> RobotIdentity:
    """The test robot's identity in a fleet."""
    key = new_key()
    identity = RobotIdentity(
        robot=WHO.robot_id,
        fleet=ca.fleet,
        url="https://localhost",
        system_trust=False,
        grpc_port=0,
        grpc_tls=True,
        certificate=ca.robot(key.public_key(), WHO.robot_id),
        chain=ca.chain,
        roots=ca.roots,
        key=key_to_pem(key),
    )
    return replace(identity, **changes)  # type: ignore[arg-type]


class Enrolled(Owner):
    """An agent's queues, with its identity."""

    def __init__(self, credentials: Credentials | None) -> None:
        super().__init__()
        self.credentials = credentials

    def new_session(self) -> AgentSession:
        """The next session, which can prove itself."""
        session = super().new_session()
        session._credentials = self.credentials
        return session


@pytest.mark.parametrize(("tls", "mutual", "challenges"), [(True, True, 0), (True, False, 3), (False, False, 3)])
async def test_grpc_knows_the_robot_by_tls_or_by_its_proof(tls: bool, mutual: bool, challenges: int) -> None:
    ca = FleetCa()
    credentials = Credentials(identity_of(ca))
    async with guarded(GuardedGrpc(ca, tls=tls, mutual=mutual)) as gateway:
        address = f"{'grpcs' if tls else 'grpc'}://localhost:{gateway.port}"
        async with running(address, owner=Enrolled(credentials), transports=transports_with(credentials)) as (
            owner,
            uplink,
        ):
            await wait(lambda: owner.ups)
            feed(owner, uplink, [b"sealed by nobody"])
            await wait(lambda: owner.held == 0)
        assert gateway.half.all_rows(1) == [b"sealed by nobody"]
        assert gateway.shown == (ROBOT,) * 3
        assert (gateway.challenges, gateway.proofs) == (challenges, challenges)


@pytest.mark.parametrize("tls", [True, False])
async def test_a_websocket_is_proved_lane_by_lane(tmp_path: Path, tls: bool) -> None:
    ca = FleetCa()
    credentials = Credentials(identity_of(ca))
    async with guarded(GuardedSocket(ca, server_context(ca, tmp_path) if tls else None)) as gateway:
        address = f"{'https' if tls else 'http'}://localhost:{gateway.port}/fleet"
        async with running(address, owner=Enrolled(credentials), transports=transports_with(credentials)) as (
            owner,
            uplink,
        ):
            await wait(lambda: owner.ups)
            feed(owner, uplink, [b"x"])
            await wait(lambda: owner.held == 0)
        assert (gateway.shown, gateway.proofs) == ((ROBOT,) * 3, 3)


async def test_the_identity_survives_a_proxy_that_ends_tls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nginx_program()
    ca, certificate = FleetCa(), make_certificate(tmp_path)
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    credentials = Credentials(identity_of(ca, system_trust=True))
    async with guarded(GuardedSocket(ca)) as gateway:
        with Nginx(tmp_path / "nginx", gateway.port, "/fleet", certificate) as nginx:
            async with running(nginx.url, owner=Enrolled(credentials), transports=transports_with(credentials)) as (
                owner,
                uplink,
            ):
                await wait(lambda: owner.ups)
                feed(owner, uplink, [b"x"])
                await wait(lambda: owner.held == 0)
        assert (gateway.shown, gateway.proofs) == ((ROBOT,) * 3, 3)


@pytest.mark.parametrize("transport", ["grpc", "websocket"])
async def test_somebody_elses_tls_gets_not_even_a_hello(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, transport: str
) -> None:
    ca, other = FleetCa(), FleetCa()
    (tmp_path / "other.pem").write_text(other.roots)
    monkeypatch.setenv(
        "SSL_CERT_FILE", str(tmp_path / "other.pem")
    )  # this system trusts it: an enrolled robot does not
    credentials = Credentials(identity_of(ca))
    gateway: GuardedGrpc | GuardedSocket
    if transport == "grpc":
        gateway = GuardedGrpc(ca, mutual=False, served_by=other)
    else:
        gateway = GuardedSocket(ca, server_context(other, tmp_path))
    async with guarded(gateway):
        end = f"grpcs://localhost:{gateway.port}" if transport == "grpc" else f"https://localhost:{gateway.port}/x"
        async with running(end, owner=Enrolled(credentials), transports=transports_with(credentials)) as (owner, _):
            await wait(lambda: len(owner.errors) >= 2)
            assert owner.ups == 0
            assert all(isinstance(error, LinkError) for error in owner.errors)
        assert gateway.half.hellos == []
        assert gateway.challenges == 0


async def test_a_challenge_of_another_fleet_is_not_answered() -> None:
    ca = FleetCa()
    credentials = Credentials(identity_of(ca))
    async with guarded(GuardedGrpc(ca, tls=False)) as gateway:
        gateway.audience = "otherfleet"
        async with running(
            f"grpc://localhost:{gateway.port}", owner=Enrolled(credentials), transports=transports_with(credentials)
        ) as (owner, _):
            await wait(lambda: owner.errors)
            assert isinstance(owner.errors[0], UnprovenError)
            assert "otherfleet" in str(owner.errors[0])
        assert gateway.proofs == 0


async def test_a_robot_that_was_never_enrolled_says_so_when_asked() -> None:
    async with guarded(GuardedGrpc(FleetCa(), tls=False)) as gateway:
        async with running(f"grpc://localhost:{gateway.port}", owner=Enrolled(None)) as (owner, _):
            await wait(lambda: owner.errors)
            assert isinstance(owner.errors[0], UnprovenError)
            assert "metaros agent enrol" in str(owner.errors[0])


async def test_a_renewal_while_data_flows_leaves_no_gap(tmp_path: Path) -> None:
    ca = FleetCa()
    with enrol_server(tmp_path, ca) as server:
        first = identity_of(ca, url=server.url)
        IdentityFiles(tmp_path).save(first)
        credentials = Credentials(first)
        renewing = RenewalTask(credentials, tmp_path, SystemClock(), random.Random(1))
        async with (
            guarded(GuardedGrpc(ca)) as gateway,
            running(
                f"grpcs://localhost:{gateway.port}",
                owner=Enrolled(credentials),
                transports=transports_with(credentials),
            ) as (owner, uplink),
        ):
            await wait(lambda: owner.ups == 1)
            feed(owner, uplink, [b"1"])
            assert await renewing.attempt()
            feed(owner, uplink, [b"2"])
            await wait(lambda: owner.held == 0)
            assert owner.ups == 1  # the link that was up stayed
            await gateway.stop()
            feed(owner, uplink, [b"3"])
            await gateway.start()
            await wait(lambda: owner.ups == 2 and owner.held == 0)
            old, new = gateway.half.hellos[0].certificates[0], gateway.half.hellos[-1].certificates[0]
            assert sorted(map(repr, gateway.half.all_rows(1))) == [repr(b"1"), repr(b"2"), repr(b"3")]
    assert credentials.identity != first
    assert (old, new) == (first.certificates()[0], credentials.certificates()[0])
    assert IdentityFiles(tmp_path).load() == credentials.identity


async def test_what_the_gateway_calls_expired_is_renewed_at_once(tmp_path: Path) -> None:
    ca = FleetCa()
    with enrol_server(tmp_path, ca) as server:
        credentials = Credentials(identity_of(ca, url=server.url))
        renewing = RenewalTask(credentials, tmp_path, SystemClock(), random.Random(1))
        assert renewing.rule.state == "fresh"
        task = asyncio.create_task(renewing.run())
        try:
            renewing.now()
            await wait(lambda: server.times("/enrol/renew") == 1)
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


async def test_a_renewal_that_fails_keeps_what_there_is_and_waits(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ca = FleetCa()
    with enrol_server(tmp_path, ca) as server:
        first = identity_of(ca, url=server.url)
        credentials = Credentials(first)
        renewing = RenewalTask(credentials, tmp_path, SystemClock(), random.Random(1))
        server.refuse = "certificate_revoked"
        assert not await renewing.attempt()
        assert not await renewing.attempt()
    assert credentials.identity == first
    assert not renewing.rule.may_ask()
    said = [record.message for record in caplog.records if "not renewed" in record.message]
    assert len(said) == 1
    assert "certificate_revoked" in said[0]
    assert "new token" in said[0]
