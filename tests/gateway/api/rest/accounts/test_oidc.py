"""Signing in at a real identity provider in this process: the flow, and everything that must not get in."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from gateway.main import Ready
from tests.gateway.harness import client, running_gateway
from tests.support.gateways.plain_http import TRUSTS_NOBODY
from tests.support.servers.oidc_server import CLIENT_ID, CLIENT_SECRET, OidcServer, another_key, oidc_server

START, BACK = "/api/v1/auth/oidc/start", "/api/v1/auth/oidc/callback"
JSON = {"Accept": "application/json"}
PAGE = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}


@pytest.fixture
def provider() -> Iterator[OidcServer]:
    with oidc_server() as server:
        yield server


@asynccontextmanager
async def world(folder: Path, provider: OidcServer, **settings: Any) -> AsyncIterator[tuple[Ready, httpx.AsyncClient]]:
    """A gateway that trusts the provider, and a browser."""
    path = folder / "oidc.json"
    document = {
        "issuer": provider.issuer,
        "client_id": CLIENT_ID,
        "client_secret": CLIENT_SECRET,
        "redirect_url": f"http://127.0.0.1:1{BACK}",  # the test goes there by itself
        "name": "Example Lab",
        "roles": {"viewer": ["robot-lookers"], "operator": ["robot-ops"], "admin": ["robot-admins"]},
        "robots": ["sim_*"],
    }
    path.write_text(json.dumps(document))
    path.chmod(0o600)
    running = running_gateway(folder, oidc=path, anonymous=False, **settings)
    async with running as ready, client(ready, key="") as browser:
        yield ready, browser


async def at_provider(browser: httpx.AsyncClient) -> dict[str, str]:
    """Begin, and sign in there: what the browser brings back."""
    begun = await browser.get(START)
    assert begun.status_code == 302, begun.text
    async with httpx.AsyncClient(trust_env=False, verify=TRUSTS_NOBODY) as remote:
        sent = await remote.get(begun.headers["location"])
    return dict(httpx.URL(sent.headers["location"]).params)


async def sign_in(browser: httpx.AsyncClient) -> httpx.Response:
    return await back(browser, await at_provider(browser))


async def back(browser: httpx.AsyncClient, params: dict[str, str]) -> httpx.Response:
    """Come back as a program does, which hears in JSON why it is refused."""
    return await browser.get(BACK, params=params, headers=JSON)


async def led_to(browser: httpx.AsyncClient, path: str, params: dict[str, str] | None = None) -> str:
    """Where a browser ends up."""
    answer = await browser.get(path, params=params, headers=PAGE)
    assert (answer.status_code, answer.content) == (302, b"")
    return answer.headers["location"]


async def me(browser: httpx.AsyncClient) -> dict[str, Any]:
    return dict((await browser.get("/api/v1/auth/me")).json())


async def test_signing_in(tmp_path: Path, provider: OidcServer) -> None:
    async with world(tmp_path, provider) as (ready, browser):
        offered = (await browser.get("/api/v1/auth/oidc")).json()
        assert offered == {"name": "Example Lab", "url": START}
        answer = await sign_in(browser)
        assert (answer.status_code, answer.headers["location"]) == (302, "/")
        account = await me(browser)
        assert (account["name"], account["role"], account["robots"]) == ("ada-l", "operator", ["sim_*"])
        out = await browser.post("/api/v1/auth/logout", json={}, headers={"X-CSRF-Token": account["csrf"]})
        assert out.status_code == 200
        admin = (ready.data_dir / "local.key").read_text().strip()
        async with client(ready, key=admin) as http:
            rows = (await http.get("/api/v1/audit", params={"action": "sessions.open"})).json()["rows"]
        assert [(row["name"], row["status"], row["target"]) for row in rows] == [("ada-l", 302, BACK)]
        assert rows[0]["detail"] == f"by {provider.issuer}"


async def test_the_role_of_today_each_time(tmp_path: Path, provider: OidcServer) -> None:
    async with world(tmp_path, provider) as (ready, browser):
        await sign_in(browser)
        first = await me(browser)
        provider.user["groups"] = ["x", "robot-admins", "robot-ops"]
        provider.user["preferred_username"] = "other"
        await sign_in(browser)
        second = await me(browser)
        assert (second["id"], second["name"], second["role"]) == (first["id"], "ada-l", "admin")
        provider.user["groups"] = ["x"]
        assert (await sign_in(browser)).status_code == 401
        admin = (ready.data_dir / "local.key").read_text().strip()
        provider.user["groups"] = ["robot-admins"]
        async with client(ready, key=admin) as http:
            body = {"name": "second", "role": "admin"}
            assert (await http.post("/api/v1/users", json=body)).status_code == 201
            assert (await http.patch("/api/v1/users/ada-l", json={"disabled": True})).status_code == 200
        assert (await sign_in(browser)).status_code == 401


async def test_a_name_in_common_is_no_account_in_common(tmp_path: Path, provider: OidcServer) -> None:
    async with world(tmp_path, provider) as (ready, browser):
        admin = (ready.data_dir / "local.key").read_text().strip()
        async with client(ready, key=admin) as http:
            assert (await http.post("/api/v1/users", json={"name": "ada-l", "role": "admin"})).status_code == 201
        await sign_in(browser)
        account = await me(browser)
        assert account["name"].startswith("ada-l.")
        assert account["role"] == "operator"


TOKENS: tuple[dict[str, Any], ...] = (  # what is wrong with the provider's token, by the provider's fields
    {"claims": {"iss": "https://other.example"}},
    {"claims": {"aud": "another"}},
    {"claims": {"aud": [CLIENT_ID, "another"]}},
    {"claims": {"azp": "another"}},
    {"claims": {"nonce": "n"}},
    {"claims": {"nonce": None}},
    {"claims": {"exp": 1_000_000_000}},
    {"claims": {"exp": None}},
    {"claims": {"iat": None}},
    {"claims": {"iat": 99_000_000_000}},
    {"claims": {"nbf": 99_000_000_000}},
    {"claims": {"sub": None}},
    {"claims": {"sub": ""}},
    {"claims": {"sub": 7}},
    {"claims": {"groups": []}},
    {"claims": {"groups": None}},
    {"claims": {"groups": {"robot-ops": 1}}},
    {"algorithm": "none"},
    {"algorithm": "HS256"},
    {"signing": "stranger"},
)


async def test_tokens_that_do_not_hold(tmp_path: Path, provider: OidcServer) -> None:
    wrong = []
    async with world(tmp_path, provider, sign_ins_per_min=0.0) as (_, browser):
        for fields in TOKENS:
            fields = {"signing": another_key()} if "signing" in fields else fields
            with provider.saying(**fields):
                answer = await sign_in(browser)
            got = (answer.status_code, answer.status_code == 401 and answer.json()["code"])
            inside = (await browser.get("/api/v1/auth/me")).status_code
            if got != (401, "bad_credentials") or inside != 401:
                wrong.append((fields, got, inside))
        assert wrong == []
        assert (await sign_in(browser)).status_code == 302


async def test_a_provider_with_new_keys(tmp_path: Path, provider: OidcServer) -> None:
    async with world(tmp_path, provider) as (_, browser):
        assert (await sign_in(browser)).status_code == 302
        provider.new_key()
        assert (await sign_in(browser)).status_code == 302


async def test_somebody_elses_sign_in(tmp_path: Path, provider: OidcServer) -> None:
    async with world(tmp_path, provider) as (ready, browser), client(ready, key="") as other:
        params = await at_provider(browser)
        assert (await back(other, params)).status_code == 401  # no cookie
        await at_provider(other)
        assert (await back(other, params)).status_code == 401  # another state
        assert (await back(browser, {**params, "state": params["state"] + "x"})).status_code == 401
        assert (await back(browser, {**params, "code": "guessed"})).status_code == 401
        assert (await back(browser, {"error": "access_denied", "state": params["state"]})).status_code == 401
        assert (await back(browser, params)).status_code == 302
        again = await back(browser, params)
        assert again.status_code == 401  # a code works once


DISCOVERY, KEYS = "/.well-known/openid-configuration", "/jwks"
PROVIDERS: tuple[dict[str, Any], ...] = (  # that answer badly, or lead where the gateway must not go
    {"answers": {DISCOVERY: (200, b"{" + b" " * 300_000, {})}},
    {"answers": {DISCOVERY: (200, b"[]", {})}},
    {"answers": {DISCOVERY: (200, b"\xff", {})}},
    {"answers": {DISCOVERY: (500, b"{}", {})}},
    {"answers": {DISCOVERY: (302, b"", {"Location": KEYS})}},
    {"answers": {KEYS: (200, b'{"keys": 1}', {})}},
    {"answers": {KEYS: (200, b'{"keys": [1]}', {})}},
    {"answers": {KEYS: (200, b'{"keys": [{"kty": "RSA"}]}', {})}},
    {"discovery": {"issuer": "https://other.example"}},
    {"discovery": {"token_endpoint": "http://127.0.0.1:1/token"}},
    {"discovery": {"token_endpoint": "https://user@example.com/token"}},
    {"discovery": {"jwks_uri": "https://localhost/jwks"}},
    {"discovery": {"jwks_uri": "https://[::ffff:10.0.0.1]/jwks"}},
    {"discovery": {"jwks_uri": "https://169.254.169.254/latest"}},
    {"discovery": {"jwks_uri": "file:///etc/passwd"}},
    {"discovery": {"jwks_uri": None}},
    {"discovery": {"authorization_endpoint": "javascript:alert(1)"}},
)


async def test_a_provider_that_answers_badly_or_leads_remote(tmp_path: Path, provider: OidcServer) -> None:
    wrong = []
    async with world(tmp_path, provider, sign_ins_per_min=0.0) as (_, browser):
        for fields in PROVIDERS:
            with provider.saying(**fields):
                answer = await browser.get(START, headers=JSON)
            got = (answer.status_code, answer.status_code == 503 and answer.json()["code"])
            if got != (503, "provider_unavailable"):
                wrong.append((fields, got))
        assert wrong == []
        with provider.saying(answers={DISCOVERY: (500, b"{}", {})}):
            assert await led_to(browser, START) == "/signin?refused=provider_unavailable"
        assert (await browser.get(START)).status_code == 302


async def test_a_refused_browser_is_led_to_the_sign_in_page_with_a_code(tmp_path: Path, provider: OidcServer) -> None:
    async with world(tmp_path, provider) as (ready, browser), client(ready, key="") as other:
        params = await at_provider(browser)
        said = {"error": "access_denied", "error_description": "<b>call 0123</b>", "state": params["state"]}
        assert await led_to(browser, BACK, said) == "/signin?refused=oidc_denied"
        assert await led_to(other, BACK, params) == "/signin?refused=oidc_state"
        assert await led_to(browser, BACK, {**params, "code": "guessed"}) == "/signin?refused=oidc_code"
        provider.claims = {"aud": "another"}
        assert await led_to(browser, BACK, await at_provider(browser)) == "/signin?refused=oidc_token"
        provider.claims = {"groups": []}
        assert await led_to(browser, BACK, await at_provider(browser)) == "/signin?refused=oidc_role"
        provider.claims = {}
        assert await led_to(browser, BACK, await at_provider(browser)) == "/"
        admin = (ready.data_dir / "local.key").read_text().strip()
        async with client(ready, key=admin) as http:
            assert (await http.patch("/api/v1/users/ada-l", json={"disabled": True})).status_code == 200
            assert await led_to(browser, BACK, await at_provider(browser)) == "/signin?refused=oidc_disabled"
            params = await at_provider(browser)
            provider.answers["/token"] = (200, b"{}", {})
            assert await led_to(browser, BACK, params) == "/signin?refused=provider_unavailable"
            rows = (await http.get("/api/v1/audit", params={"action": "sessions.open"})).json()["rows"]
    refused = [(row["status"], row["code"]) for row in rows if row["code"]]
    assert (401, "bad_credentials") in refused  # where the browser was led changes nothing for the log


async def test_browsers_that_are_refused_count_as_failed_sign_ins(tmp_path: Path, provider: OidcServer) -> None:
    async with world(tmp_path, provider) as (_, browser):
        seen = [await led_to(browser, BACK, {"error": "x"}) for _ in range(11)]
        assert (seen[0], seen[-1]) == ("/signin?refused=oidc_denied", "/signin?refused=too_many_requests")


async def test_without_a_provider(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key="") as browser:
        assert (await browser.get("/api/v1/auth/oidc")).json() == {"name": None, "url": None}
        for path in (START, BACK):
            assert (await browser.get(path)).status_code == 404
