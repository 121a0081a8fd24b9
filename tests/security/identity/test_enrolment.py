"""From a token to a link, the agent's own code against a real gateway: who gets in, how, and who does not."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx
import pytest

from edge_agent.config.gateway_address import TransportSetting
from edge_agent.errors import EnrolRefusedError, PinError, RefusedError, UnprovenError
from edge_agent.identity.credentials import Credentials, enrolled_addresses
from edge_agent.identity.enrol import enrol, renew
from edge_agent.identity.enrolment_token import parse_token
from edge_agent.identity.files import IdentityFiles, RobotIdentity
from edge_agent.uplink.session import AgentSession
from edge_agent.uplink.uplink import Uplink, transports_with
from gateway.domain.principal import Role
from gateway.main import Ready
from tests.gateway.harness import client, running_gateway
from tests.support.gateways.memory_authenticator import KeyRing
from tests.support.robots.uplinks import WHO, Owner, feed, running, wait
from tests.support.servers.certificates import make_certificate
from tests.support.servers.nginx import Nginx, nginx_program

RING = KeyRing()
ADMIN = RING.add(role=Role.ADMIN, name="ada")
ROBOT = WHO.robot_id


class Enrolled(Owner):
    """An agent's queues, with or without an identity."""

    def __init__(self, credentials: Credentials | None) -> None:
        super().__init__()
        self._credentials = credentials

    def new_session(self) -> AgentSession:
        """The next session."""
        session = super().new_session()
        session._credentials = self._credentials
        return session


async def order(ready: Ready, **body: object) -> str:
    """A token, as an administrator gets it."""
    async with client(ready, key=ADMIN) as http:
        http.timeout = httpx.Timeout(60)
        answer = await http.post("/api/v1/enrolment-tokens", json=body)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["token"])


async def revoke(ready: Ready) -> None:
    """What an administrator does to a stolen robot."""
    async with client(ready, key=ADMIN) as http:
        http.timeout = httpx.Timeout(60)
        answer = await http.post(f"/api/v1/robots/{ROBOT}/revoke", json={"reason": "stolen"})
        assert answer.status_code == 200, answer.text


async def enrol_robot(ready: Ready, state: Path, token: str = "", *, url: str = "") -> RobotIdentity:
    """What `metaros agent enrol` does."""
    text = token or await order(ready)
    return await asyncio.to_thread(enrol, parse_token(text), url=url or ready.url, robot_id=ROBOT, state_dir=state)


@asynccontextmanager
async def linked(identity: RobotIdentity, transport: TransportSetting) -> AsyncIterator[tuple[Owner, Uplink]]:
    """The agent's uplink, to where the enrolment says."""
    credentials = Credentials(identity)
    (address,) = enrolled_addresses(identity, transport)[:1]
    owner = Enrolled(credentials)
    async with running(address.text, owner=owner, transports=transports_with(credentials)) as pair:
        yield pair


async def carries(owner: Owner, uplink: Uplink) -> None:
    """The link is up, and a sample is stored."""
    await wait(lambda: owner.ups)
    feed(owner, uplink, [b"sample"])
    await wait(lambda: owner.held == 0)


@pytest.mark.parametrize("tls", ["on", "off"])
@pytest.mark.parametrize("transport", ["grpc", "websocket"])
async def test_from_nothing_to_a_link_that_knows_the_robot(tmp_path: Path, tls: str, transport: str) -> None:
    async with running_gateway(tmp_path, authenticator=RING, tls=tls, require_enrolment=True) as ready:
        identity = await enrol_robot(ready, tmp_path)
        assert identity.grpc_tls is (tls == "on")
        async with linked(identity, "grpc" if transport == "grpc" else "websocket") as (owner, uplink):
            await carries(owner, uplink)
            assert owner.facts.transport == transport


async def test_the_identity_survives_a_proxy_that_ends_tls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nginx_program()
    certificate = make_certificate(tmp_path)
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    async with running_gateway(tmp_path, authenticator=RING, require_enrolment=True) as ready:
        with Nginx(tmp_path / "nginx", ready.http_port, "/fleet", certificate) as nginx:
            identity = await enrol_robot(ready, tmp_path, url=nginx.url)
            assert identity.system_trust
            async with linked(identity, "websocket") as (owner, uplink):
                await carries(owner, uplink)
            assert (await asyncio.to_thread(renew, identity, tmp_path)).certificate != identity.certificate


async def test_a_token_is_good_once_for_its_robot_and_its_fleet(tmp_path: Path) -> None:
    async with (
        running_gateway(tmp_path / "one", authenticator=RING) as ready,
        running_gateway(tmp_path / "two", authenticator=RING) as other,
    ):
        token = await order(ready, robot=ROBOT)
        with pytest.raises(PinError):
            await enrol_robot(other, tmp_path / "a", token)
        first = await enrol_robot(ready, tmp_path / "a", token)
        for text, code in ((token, "token_used"), (await order(ready, robot="leg"), "token_foreign")):
            with pytest.raises(EnrolRefusedError) as refused:
                await enrol_robot(ready, tmp_path / "b", text)
            assert refused.value.reason == code
        assert IdentityFiles(tmp_path / "a").load() == first
        assert IdentityFiles(tmp_path / "b").load() is None


async def test_a_live_robot_is_cut_when_it_is_revoked_and_comes_back_by_a_new_token(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING, tls="on") as ready:
        identity = await enrol_robot(ready, tmp_path)
        async with linked(identity, "grpc") as (owner, uplink):
            await carries(owner, uplink)
            await revoke(ready)
            await wait(lambda: owner.errors)
            assert isinstance(owner.errors[0], RefusedError)
            assert owner.errors[0].reason == "certificate_revoked"
        with pytest.raises(EnrolRefusedError, match="certificate_revoked"):
            await asyncio.to_thread(renew, identity, tmp_path)
        again = await enrol_robot(ready, tmp_path, await order(ready, robot=ROBOT))
        async with linked(again, "grpc") as (owner, uplink):
            await carries(owner, uplink)


async def test_a_renewed_certificate_links_and_its_key_is_new(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING, tls="on") as ready:
        first = await enrol_robot(ready, tmp_path)
        second = await asyncio.to_thread(renew, first, tmp_path)
        assert (second.key, second.certificate) != (first.key, first.certificate)
        assert IdentityFiles(tmp_path).load() == second
        async with linked(second, "grpc") as (owner, uplink):
            await carries(owner, uplink)


async def test_two_renewals_with_different_keys_are_a_clone(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        identity = await enrol_robot(ready, tmp_path / "robot")
        await asyncio.to_thread(renew, identity, tmp_path / "robot")
        with pytest.raises(EnrolRefusedError, match="clone_detected"):
            await asyncio.to_thread(renew, identity, tmp_path / "copy")


async def test_without_an_identity_nobody_speaks_for_an_enrolled_robot(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        await enrol_robot(ready, tmp_path)
        async with running(f"grpc://127.0.0.1:{ready.grpc_port}", owner=Enrolled(None)) as (owner, _):
            await wait(lambda: owner.errors)
            error = owner.errors[0]
            assert isinstance(error, UnprovenError) or getattr(error, "reason", "") == "not_enrolled"
            assert owner.ups == 0
