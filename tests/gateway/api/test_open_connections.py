"""Open sockets of who may not be here any more are ended; what waits for others goes on."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from starlette.requests import HTTPConnection
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus

from gateway.api.authorization import CREDENTIAL_KEY, PRINCIPAL_KEY
from gateway.api.middleware.authenticate import Credential
from gateway.api.open_connections import OpenConnections
from gateway.domain.principal import Principal, Role
from gateway.errors import CredentialsError, StoreError
from gateway.identity.store_authenticator import REMEMBERED_S
from metaros._proto import link_pb2
from metaros.limits import LIMITS
from tests.gateway.api.foxglove.viewer import viewing
from tests.gateway.harness import CONTROL, ScriptedAgent, client, hear, open_socket, running_gateway, say
from tests.support.gateways.memory_authenticator import KeyRing


async def end_of(socket: ClientConnection) -> tuple[int, str]:
    """How the gateway closes a socket."""
    async with asyncio.timeout(60):
        await socket.wait_closed()
    return socket.close_code or 0, socket.close_reason or ""


def test_it_asks_often_enough() -> None:
    assert LIMITS.credential_check_s + REMEMBERED_S < 5.0, "a revoked credential's sockets end within 5 s"


async def test_a_stream_ends_when_its_key_changes(tmp_path: Path, attentive: None) -> None:
    ring = KeyRing()
    keys = [ring.add(role=Role.OPERATOR) for _ in range(3)]
    revoked, demoted, narrowed = [await ring.by_key(key) for key in keys]
    assert revoked is not None
    assert demoted is not None
    assert narrowed is not None
    path = "/api/v1/stream"
    async with running_gateway(tmp_path, authenticator=ring) as ready, AsyncExitStack() as stack:
        staying = ring.add(role=Role.VIEWER)
        sockets = [await stack.enter_async_context(open_socket(ready, path, key=key)) for key in (*keys, *keys)]
        other = await stack.enter_async_context(open_socket(ready, path, key=staying))
        for socket in (*sockets, other):
            await hear(socket, "welcome")
        ring.revoke(keys[0])
        ring.put(keys[1], Principal(kind="key", id=demoted.id, role=Role.VIEWER, robots=demoted.robots))
        ring.put(keys[2], Principal(kind="key", id=narrowed.id, role=narrowed.role, robots=("r1",)))
        assert {await end_of(socket) for socket in sockets} == {(4401, "bad_credentials")}
        await say(other, op="subscribe_fleet", id=1)
        await hear(other, "fleet")


async def test_a_session_that_ends_takes_its_stream_with_it(tmp_path: Path, attentive: None) -> None:
    ring = KeyRing()
    token, _ = ring.sign_in(role=Role.VIEWER)
    async with running_gateway(tmp_path, authenticator=ring, anonymous=False) as ready:
        cookie = {"Cookie": f"metaros_session={token}"}
        url = ready.url.replace("http", "ws", 1) + "/api/v1/stream"
        async with connect(url, origin=ready.url, additional_headers=cookie, proxy=None) as socket:
            await hear(socket, "welcome")
            ring.revoke(token)
            assert await end_of(socket) == (4401, "bad_credentials")


async def test_a_driver_whose_key_is_revoked_stops_and_gives_the_lease_back(tmp_path: Path, attentive: None) -> None:
    ring = KeyRing()
    key, next_key = ring.add(role=Role.OPERATOR), ring.add(role=Role.OPERATOR)
    path = "/api/v1/robots/sim_1/teleop"
    async with running_gateway(tmp_path, authenticator=ring) as ready, ScriptedAgent(ready) as agent:
        async with open_socket(ready, path, key=key) as socket:
            await say(socket, op="take", holder="ann")
            grant = (await agent.next("command")).command
            assert grant.WhichOneof("action") == "grant_lease"
            await agent.answer(grant)
            await hear(socket, "granted")
            ring.revoke(key)
            stop = (await agent.next("teleop", CONTROL)).teleop
            assert stop.payload.strip(b"\x00") in (b"", b"\x01"), "all zero behind CDR's header"
            release = (await agent.next("command")).command
            assert release.WhichOneof("action") == "release_lease"
            await agent.answer(release)
            assert await end_of(socket) == (4401, "bad_credentials")
        async with open_socket(ready, path, key=next_key) as socket:
            await say(socket, op="take", holder="ben")
            await agent.answer((await agent.next("command")).command)
            await hear(socket, "granted")
            closing = asyncio.create_task(socket.close())
            command: link_pb2.Command = (await agent.next("command")).command
            await agent.answer(command)
            await closing


async def test_a_key_as_a_subprotocol_is_never_echoed(tmp_path: Path) -> None:
    ring = KeyRing()
    key = ring.add(role=Role.VIEWER)
    async with running_gateway(tmp_path, authenticator=ring, anonymous=False) as ready:
        offered: list[Any] = ["metaros.v1", f"metaros.key.{key}"]
        async with open_socket(ready, "/api/v1/stream", key="", subprotocols=offered) as socket:
            assert socket.subprotocol == "metaros.v1"
            await hear(socket, "welcome")
        async with open_socket(ready, "/api/v1/stream", key="", subprotocols=offered[1:]) as socket:
            assert socket.subprotocol is None
            await hear(socket, "welcome")
        async with client(ready, key=key) as http:
            assert (await http.get("/api/v1/robots")).status_code == 200


def test_nobody_takes_all_places() -> None:
    open_connections = OpenConnections(KeyRing(), limits=replace(LIMITS, viewers=3, viewers_each=2))
    one, two = (Principal(kind="user", id=name, role=Role.VIEWER) for name in ("one", "two"))
    with ExitStack() as places:
        for _ in range(2):
            assert not open_connections.viewers_full(one)
            places.enter_context(open_connections.count_viewer(one))
        assert open_connections.viewers_full(one)
        assert not open_connections.viewers_full(two)
        with open_connections.count_viewer(two):
            assert open_connections.viewers_full(Principal(kind="key", id="two"))
    assert not open_connections.viewers_full(one)


async def test_who_has_all_of_his_places_is_reported_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = partial(OpenConnections, limits=replace(LIMITS, viewers_each=1))
    monkeypatch.setattr("gateway.wiring.gateway.OpenConnections", few)
    ring = KeyRing()
    greedy, other = ring.add(role=Role.VIEWER), ring.add(role=Role.VIEWER)
    async with running_gateway(tmp_path, authenticator=ring) as ready:
        async with open_socket(ready, "/api/v1/stream", key=greedy) as first:
            await hear(first, "welcome")
            for path in ("/api/v1/stream", "/rosbridge"):
                async with open_socket(ready, path, key=greedy) as refused:
                    assert await end_of(refused) == (4429, "too_many")
            with pytest.raises(InvalidStatus) as denied:
                async with viewing(ready, key=greedy):
                    pass
            assert denied.value.response.status_code == 429
            async with open_socket(ready, "/api/v1/stream", key=other) as second:
                await hear(second, "welcome")


async def test_sockets_stay_while_the_store_cannot_answer() -> None:
    class Broken(KeyRing):
        broken = True

        async def by_key(self, text: str) -> Principal | None:
            if self.broken:
                raise StoreError("not now")
            return await super().by_key(text)

    ring = Broken()
    open_connections = OpenConnections(ring)
    who = Principal(kind="key", id="1", role=Role.VIEWER)
    scope = {"type": "websocket", PRINCIPAL_KEY: who, CREDENTIAL_KEY: Credential("key", "gone")}
    with open_connections.track(HTTPConnection(scope)) as opened:
        await open_connections.check()
        assert not opened.revoked.is_set()
        ring.broken = False
        await open_connections.check()
        assert opened.revoked.is_set()
    with open_connections.track(HTTPConnection({"type": "websocket"})) as opened:
        await open_connections.check()
        assert not opened.revoked.is_set(), "nobody has nothing to revoke"


async def test_a_download_ends_with_its_key() -> None:
    ring = KeyRing()
    key = ring.add(role=Role.VIEWER)
    open_connections = OpenConnections(ring)
    scope = {"type": "http", PRINCIPAL_KEY: await ring.by_key(key), CREDENTIAL_KEY: Credential("key", key)}
    got: list[bytes] = []

    async def endless() -> AsyncIterator[bytes]:
        for number in range(10):
            if number == 3:
                await open_connections.check()
            if number == 6:
                ring.revoke(key)
                await open_connections.check()
            yield bytes([number])

    async def fetch() -> None:
        pieces = open_connections.while_allowed(HTTPConnection(scope), endless())
        while True:
            got.append(await anext(pieces))

    with pytest.raises(CredentialsError):
        await fetch()
    assert b"".join(got) == bytes(range(6))
