"""Who asks: where a credential is looked for, and what happens while the store cannot say whose it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus

from gateway.api.middleware.authenticate import Authenticate, Credential, plain_protocol
from gateway.domain.principal import Principal, Role
from gateway.errors import StoreError
from tests.gateway.harness import bearer, client, open_socket, running_gateway
from tests.support.gateways.memory_authenticator import KeyRing

KEY, TOKEN = "metaros.principal", "metaros.refusal"


class Away(KeyRing):
    """An endpoint whose store is down."""

    async def by_key(self, text: str) -> Principal | None:
        """Nobody can say."""
        raise StoreError("the store cannot be read")


async def seen(ring: KeyRing, *headers: tuple[str, str], **scope: Any) -> dict[str, Any]:
    """The scope as the application gets it."""
    got: dict[str, Any] = {}

    async def app(inner: Any, _receive: Any, _send: Any) -> None:
        got.update(inner)

    raw = [(name.lower().encode(), value.encode()) for name, value in headers]
    asked = {"type": "http", "path": "/api/v1/robots", "client": ("127.0.0.1", 5), "headers": raw, **scope}
    wrapped: Any = Authenticate(app, ring, anonymous=True)
    await wrapped(asked, None, None)
    return got


LOCAL = ("Host", "localhost:8080")


async def test_nobody_on_this_machine_is_a_viewer() -> None:
    for address in ("127.0.0.1", "127.8.9.1", "::1"):
        got = await seen(KeyRing(), LOCAL, client=(address, 1))
        assert (got[KEY].kind, got[KEY].role) == ("anonymous", Role.VIEWER), address


async def test_nobody_from_remote_is_nobody() -> None:
    for address in ("10.0.0.1", "::ffff:10.0.0.1", "203.0.113.5", "", "unix:"):
        assert (await seen(KeyRing(), LOCAL, client=(address, 1)))[KEY].role is Role.NONE, address
    assert (await seen(KeyRing(), LOCAL, client=None))[KEY].role is Role.NONE


async def test_a_key_goes_before_a_cookie_and_what_is_not_good_is_remembered() -> None:
    ring = KeyRing()
    key, (token, _) = ring.add(role=Role.VIEWER, name="k"), ring.sign_in(role=Role.ADMIN, name="s")
    cookie = ("Cookie", f"theme=dark; metaros_session={token}; other=1")
    assert (await seen(ring, cookie))[KEY].name == "s"
    assert (await seen(ring, cookie, ("Authorization", f"Bearer {key}")))[KEY].name == "k"
    assert (await seen(ring, cookie, ("Authorization", f"bearer {key}")))[KEY].name == "k"
    for bad in (f"Bearer {token}", "Bearer", "Basic x", f"Bearer {key} {key}"):
        got = await seen(ring, LOCAL, cookie, ("Authorization", bad))
        assert got[TOKEN].code == "bad_credentials"
        assert got[KEY].role is Role.NONE
    twice = await seen(ring, ("Authorization", f"Bearer {key}"), ("Authorization", f"Bearer {key}"))
    assert twice[TOKEN].code == "bad_credentials"
    unread = await seen(ring, ("Cookie", f"metaros_session={token}; no,name=1"))
    assert (unread[TOKEN].code, str(unread[TOKEN])) == ("bad_credentials", "the cookie cannot be read")
    assert unread[KEY].role is Role.NONE


async def test_the_page_itself_is_asked_for_no_credential() -> None:
    assert KEY not in await seen(KeyRing(), ("Authorization", "Bearer x"), path="/assets/app.js")


def test_a_credential_never_shows_itself() -> None:
    assert "hush" not in repr(Credential("key", "hush"))
    assert plain_protocol({"subprotocols": ["metaros.key.hush"]}) is None
    assert plain_protocol({"subprotocols": ["metaros.key.hush", "metaros.v1"]}) == "metaros.v1"


async def test_while_the_store_cannot_say_nobody_is_let_in_and_nobody_is_called_a_liar(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=Away()) as ready, client(ready, key="") as http:
        answer = await http.get("/api/v1/robots", headers=bearer("mrk_1_2"))
        assert (answer.status_code, answer.json()["code"]) == (503, "store_unavailable")
        assert (await http.get("/healthz", headers=bearer("mrk_1_2"))).status_code == 200


async def test_a_refused_socket_is_answered_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with running_gateway(tmp_path, anonymous=False) as ready:
        with pytest.raises(InvalidStatus) as refused:
            async with open_socket(ready, "/api/v1/stream", key=""):
                pass
        assert refused.value.response.status_code == 401
        async with client(ready, key="") as http:  # the socket's task is over by then
            assert (await http.get("/healthz")).status_code == 200
    assert [record.getMessage() for record in caplog.records if record.exc_info] == []
